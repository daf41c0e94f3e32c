"""Straight touches ranked by a strategy's formula, with what each may report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..recognizer import Belief
from ..recognizer.predict.pose_samples import sample_belief
from ..recognizer.predict.prediction import MET_OBJECT, PoseSamples, Predictions, predict
from ..recognizer.predict.probes import ProbeSpace, TriadRays
from .decision_region import edges_cut
from .information import information
from .lookahead import two_ahead
from .minimax import worst_case
from .outcomes.outcomes import Outcomes
from .outcomes.reports import Purpose, Suggestion, reports_of
from .outcomes.rivals import taken, thinned
from .outcomes.task import Observation, Task
from .outcomes.weighing import TELLS_NOTHING, evened, precision
from .pairs import pairs_told_apart
from .pruning import weight_removed
from .rate import Rate
from .refine import log_determinant
from .separation import separation
from .straight import LEVEL, Reach, Region, Touches, across_direction

Floats = NDArray[np.float64]


def _two_ahead(task: Task, observation: Observation, outcomes: Outcomes) -> Floats:
    alone = information(task, observation, outcomes)
    return two_ahead(outcomes.left, outcomes.weights, outcomes.chances, alone)


def _rate(task: Task, observation: Observation, outcomes: Outcomes) -> Floats:
    told = information(task, observation, outcomes)
    return told / Rate(task).seconds(observation, outcomes)


def _refine(task: Task, observation: Observation, outcomes: Outcomes) -> Floats:
    # The pose is refined when one is left, as `Refine` has it.
    if not outcomes.same.all():
        return information(task, observation, outcomes)
    return log_determinant(observation, outcomes)


FORMULAS: dict[str, Callable[[Task, Observation, Outcomes], Floats]] = {
    "information": information,
    "separation": lambda _, __, outcomes: separation(outcomes),
    "pairs": lambda _, __, outcomes: pairs_told_apart(outcomes),
    "minimax": lambda _, __, outcomes: worst_case(outcomes),
    "pruning": lambda _, __, outcomes: weight_removed(outcomes),
    "decision-region": lambda _, __, outcomes: edges_cut(outcomes),
    "rate": _rate,
    "lookahead": _two_ahead,
    "refine": _refine,
}
"""The strategies whose formula weighs any probe, by name: (a,) worth, the largest is the best."""

SHOWN, WEIGHED = 256, 64
"""Poses that stand for a belief in what is reported, and in what is weighed."""
CANDIDATES = 400
"""Touches thought of."""
SHORTLIST = 24
"""Of these, how many are looked at thoroughly, ..."""
BESIDE = 5
"""... each itself and with four beside it ..."""
AIM = 0.005
"""... as far as this, as a share of the smallest object's diameter: the hand that
makes a touch is that far off, and an edge so near says little."""
MARGIN = 0.1
"""Of the region around the belief's poses, as a share of the largest object's diameter."""
EASIER = 0.03
"""Share of its worth by which a touch askew has to be better than one along an axis."""
APART = 0.1
"""Share of the smallest diameter below which two touches along one direction are one suggestion,"""
TURNED = np.cos(np.radians(20.0))
"""and cosine of the angle up to which two directions are one."""


def ranked_touches(
    belief: Belief,
    reach_of: Callable[[Region], Reach],
    policy: str,
    count: int,
    rng: np.random.Generator,
) -> tuple[Suggestion, ...]:
    """The touches that a strategy's formula likes best, far enough apart to be a choice.

    Args:
        belief: what the contacts so far allow.
        reach_of: gives the touches that can be made, of the box around what the belief leaves.
        policy: a name in `FORMULAS`.
        count: how many, at most.
        rng: source of the touches thought of.
    """
    models = belief.library.models
    everything = _within_what_is_known(sample_belief(belief, models, SHOWN), belief)
    if not len(everything):
        return ()
    smallest, largest = (pick(model.diameter for model in models) for pick in (min, max))
    reach = reach_of(Region.around(everything, MARGIN * largest))
    samples = thinned(everything, WEIGHED)
    touches = Touches.join(
        [reach.aimed(samples, CANDIDATES // 2, rng), reach.spread(CANDIDATES // 2)]
    )
    # From where nothing is in the way, whatever is true: the probe has a shaft.
    touches = touches[_free_to_start(everything, touches, reach.region, AIM * smallest)]
    if not len(touches):
        return ()
    task, observation = _task(belief, reach.region), _observation(belief)
    evenly = evened(samples)

    def outcomes_of(tried: Touches) -> Outcomes:
        told = _predicted(evenly, tried, reach.region)
        return Outcomes.of_predictions(
            task, evenly, tried.starts, tried.rays, told, samples.weights
        )

    weigh = partial(FORMULAS[policy], task, observation)
    outcomes = outcomes_of(touches)
    worth, gone = weigh(outcomes), weight_removed(outcomes)
    telling = gone >= TELLS_NOTHING
    if not telling.any():
        worth = precision(observation, outcomes)
    best = np.argsort(-worth, kind="stable")[:SHORTLIST]
    touches, tells = touches[best], bool(telling.any())
    everywhere, rows = outcomes_of(_beside(touches, AIM * smallest)), np.arange(len(touches))
    around = [everywhere.thoroughly(rows + k * len(touches)) for k in range(BESIDE)]
    worth = np.min([weigh(each) if tells else precision(observation, each) for each in around], 0)
    gone = weight_removed(around[0])
    named = (touches.directions @ reach.named.T).max(axis=1) > 1.0 - LEVEL
    order = np.argsort(-np.where(named, worth, (1.0 - EASIER) * worth), kind="stable")
    chosen = _far_apart(touches, order[worth[order] > 0.0], APART * smallest)[:count]
    told = _predicted(everything, touches, reach.region)
    return tuple(
        Suggestion(
            start_world=touches.starts[row],
            direction_world=touches.directions[row],
            length=float(touches.lengths[row]),
            purpose=Purpose.TELL_APART if gone[row] >= TELLS_NOTHING else Purpose.REFINE,
            score=float(worth[row]),
            rules_out=float(gone[row]),
            reports=reports_of(
                everything,
                _only(told, row),
                touches.starts[row],
                touches.directions[row],
                position_error=task.position_error,
                normal_error=task.normal_error,
            ),
        )
        for row in chosen
    )


def _task(belief: Belief, region: Region) -> Task:
    """The session as strategies know one, with the median bounds of the contacts so far."""
    contacts = belief.contacts
    felt = contacts.normal_error[contacts.normal_error < np.pi]
    return Task(
        library=belief.library.models,
        # Of triads, which nobody sends here.
        space=ProbeSpace(half_width=0.5 * region.diagonal, reach=region.diagonal),
        position_error=float(np.median(contacts.position_error)),
        normal_error=float(np.median(felt)) if len(felt) else np.pi,
        free_space=True,
        tolerance=belief.tolerance,
    )


def _observation(belief: Belief) -> Observation:
    """What formulas read of an environment's observation."""
    contacts, ways = belief.contacts, belief.free_space
    read: dict[str, NDArray[np.generic]] = {
        "contact_count": np.array([len(contacts)]),
        "contact_positions": contacts.positions,
        "contact_normals": contacts.normals,
        "contact_position_error": contacts.position_error,
        "contact_normal_error": contacts.normal_error,
        "ray_count": np.array([len(ways)]),
        "ray_starts": ways.starts,
    }
    # Rotations don't take arrays that are read-only.
    return {name: values.copy() for name, values in read.items()}


def _within_what_is_known(samples: PoseSamples, belief: Belief) -> PoseSamples:
    """Samples without those that the free space or the support rules out.

    Those of an open hypothesis are spread over all that its contacts allow. Its own pose stays.
    """
    own = np.unique(samples.hypotheses, return_index=True)[1]
    good = np.ones(len(samples), bool)
    ways, support = belief.free_space, belief.support
    if len(ways) and len(samples):
        along = ways.ends - ways.starts
        lengths = np.linalg.norm(along, axis=1)
        moved = lengths > 0.0
        directions = (along[moved] / lengths[moved, None])[:, None]
        rays = TriadRays(ways.starts[moved, None], directions)
        told = predict(samples, rays, ends=lengths[moved, None])
        slopes = np.abs(np.einsum("sakx,akx->sak", told.normals_world, directions))
        slack = 2.0 * ways.error[moved, None] + 3.0 * told.depth_spread * slopes
        deep = slopes * (lengths[moved, None] - told.depths) > slack
        good &= ~((told.outcomes == MET_OBJECT) & deep).any(axis=(1, 2))
    if support is not None:
        turns = Rotation.from_quat(samples.rotations).as_matrix()
        for row, number in enumerate(samples.objects):
            corners = samples.models[number].vertices @ turns[row].T + samples.positions[row]
            room = support.error + 3.0 * samples.position_spread[row]
            good[row] &= float((corners @ support.up).min()) > support.height - room
    good[own] = True
    return samples if good.all() else taken(samples, np.flatnonzero(good))


def _far_back(samples: PoseSamples, region: Region) -> float:
    """How far before a region a ray starts outside every object, metres."""
    largest = max(model.diameter for model in samples.models)
    away = np.linalg.norm(samples.positions - region.middle, axis=1).max()
    offset = max(float(np.linalg.norm(model.centroid)) for model in samples.models)
    return float(away) + offset + largest + region.diagonal


def _predicted(samples: PoseSamples, touches: Touches, region: Region) -> Predictions:
    """What samples say of touches: cast from far back, as rays start outside the objects."""
    back = _far_back(samples, region)
    starts, directions = touches.starts[:, None], touches.directions[:, None]
    rays = TriadRays(starts - back * directions, directions)
    told = predict(samples, rays, ends=(touches.lengths + back)[:, None])
    return replace(told, depths=told.depths - back)


def _free_to_start(
    samples: PoseSamples, touches: Touches, region: Region, clearance: float
) -> NDArray[np.bool_]:
    """(a,) touches that no pose has the object in the way of before they start."""
    told = _predicted(samples, touches, region)
    near = (told.outcomes == MET_OBJECT) & (told.depths < clearance)
    return ~near.any(axis=(0, 2))


def _beside(touches: Touches, aim: float) -> Touches:
    """Each touch, then all of them moved by ``aim`` to either side along two directions."""
    across = np.stack([across_direction(direction) for direction in touches.directions], axis=1)
    shifts = [0.0 * across[0], aim * across[0], -aim * across[0], aim * across[1], -aim * across[1]]
    return Touches.join(
        [Touches(touches.starts + shift, touches.directions, touches.lengths) for shift in shifts]
    )


def _far_apart(touches: Touches, order: NDArray[np.int64], apart: float) -> list[int]:
    """The rows of an order, without those that are as good as one before."""
    chosen: list[int] = []
    for row in order.tolist():
        between = touches.starts[row] - touches.starts[chosen]
        direction = touches.directions[row]
        off = np.linalg.norm(between - (between @ direction)[:, None] * direction, axis=1)
        if not ((touches.directions[chosen] @ direction > TURNED) & (off < apart)).any():
            chosen.append(row)
    return chosen


def _only(told: Predictions, row: int) -> Predictions:
    """Of one probe."""
    rows = slice(row, row + 1)
    return Predictions(
        told.outcomes[:, rows],
        told.depths[:, rows],
        told.normals_world[:, rows],
        told.depth_spread[:, rows],
    )
