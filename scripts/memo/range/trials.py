"""Scans of the housing for the memo's Section 5, and what they are interpreted as."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ....assets.memo import range_setting, range_views
from ....envs.library import load_library
from ....envs.scene.placement import Resting
from ....envs.scene.scene import OBJECT, ProbeScene
from ....envs.sensors.noise import SensorNoise
from ....envs.sensors.range_sensor import MEMO_SPACING, RangeScanner
from ....envs.sensors.touch import ProbeCommand
from ....recognizer import Contacts, Hypothesis, Polyhedron, PoseTolerance
from ....recognizer.beliefs.hypotheses import cluster
from ....recognizer.models.rays import cast_rays
from ....recognizer.tree.tree import prune
from ..noise import noise_of
from ..plan import Trials
from ..trial import prepared

Floats = NDArray[np.float64]

OBJECT_NAME = "housing"
ELEVATION = np.pi / 4.0
"""How steeply the scanner looks downwards, radians."""
WIDTH, REACH = 1.5, 2.0
"""Width of the image, and how far before the plane its rays start, in diameters of the object."""
MOST_DRAWS = 200
INDEPENDENT = 0.1
"""The least triple product of three normals that count as independent."""
READINGS = (
    "as read, in the memo's bounds",
    "as bad as the memo's bounds allow",
    "in the scanner's own bounds",
)
"""What the recogniser is given of a view, see `readings`."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What some trials left."""

    counts: NDArray[np.int64]
    """(t, 3, 3) for each of `READINGS`: interpretations that the tree leaves, that the model test
    leaves, and distinct transforms."""
    sure: Floats
    """(t,) the widest bound on a normal that the scanner derived, radians."""
    lost: int
    """Trials in which the right interpretation was dropped, of any reading."""

    @classmethod
    def join(cls, parts: Sequence[Outcome]) -> Outcome:
        """All trials of all parts, at least one."""
        return cls(
            np.concatenate([part.counts for part in parts]),
            np.concatenate([part.sure for part in parts]),
            sum(part.lost for part in parts),
        )


@dataclass(frozen=True, eq=False)
class View:
    """A scan of the object, and where the object truly is."""

    model: Polyhedron
    T_world_object: RigidTransform
    command: ProbeCommand
    contacts: Contacts
    """As the scanner reports them, with its own bounds."""
    faces: NDArray[np.int32]
    """(n,) the face under each."""


def scan_views(piece: Trials[int]) -> Outcome:
    """Place, scan and recognise the object; rows are numbers of points."""
    counts, lost = np.empty((piece.count, len(READINGS), 3), np.int64), 0
    sure = np.empty(piece.count)
    for row, number in enumerate(piece.numbers):
        rng = generator(piece.seed, piece.row, number)
        view = take_view(piece.row, rng)
        sure[row] = view.contacts.normal_error.max()
        kept = True
        for column, contacts in enumerate(readings(view, rng)):
            counts[row, column], _, held = interpret(view, contacts)
            kept = kept and held
        lost += not kept
    return Outcome(counts, sure, lost)


def take_view(points: int, rng: np.random.Generator) -> View:
    """Stand the object on the plane and scan it, until a view has the points asked for.

    Placements and views are drawn anew until the scanner finds as many points as asked for, and
    three independent normals among them.

    Args:
        points: how many.
        rng: source of placements, views and noise.

    Raises:
        ValueError: no view has them.
    """
    scene, placement, scanners = scanning()
    model = scene.model
    for _ in range(MOST_DRAWS):
        scene.place(placement.draw(rng, model))
        centre = scene.T_world_object.apply(model.centroid)
        command = ProbeCommand(centre[0], centre[1], float(rng.uniform(-1.0, 1.0) * np.pi / 3.0))
        touch = scanners[points].touch(scene, command, rng)
        if len(touch.contacts) < points or not _independent(touch.contacts.normals):
            continue
        starts = touch.starts_world[touch.outcomes == OBJECT]
        directions = np.array(touch.contacts.approaches)
        hits = cast_rays(model, scene.T_world_object, starts, directions)
        faces = hits.faces.astype(np.int32)
        return View(model, scene.T_world_object, command, touch.contacts, faces)
    raise ValueError(f"no view of {model.name} has {points} points with three independent normals")


def readings(view: View, rng: np.random.Generator) -> tuple[Contacts, Contacts, Contacts]:
    """What the recogniser is given of a view, as in `READINGS`."""
    scanned, bounds = view.contacts, memo_noise()
    limits = {"position_error": bounds.position_error, "normal_error": bounds.normal_error}
    # What the scanner itself may be off by leaves that much less of the bounds to the noise.
    worst = bounds.blur(
        rng,
        np.ones(len(scanned), np.int8),
        np.array(scanned.positions),
        np.array(scanned.normals),
        float(scanned.position_error.max()),
        float(scanned.normal_error.max()),
    )
    return (
        Contacts(scanned.positions, scanned.normals, **limits),
        Contacts(*worst, **limits),
        scanned,
    )


def interpret(
    view: View, contacts: Contacts
) -> tuple[tuple[int, int, int], list[Hypothesis], bool]:
    """Prune, test and group.

    Returns:
        Interpretations that the tree leaves and that the model test leaves, distinct transforms;
        the transforms, likeliest first; and whether the right interpretation is in one of them.
    """
    thing = prepared(OBJECT_NAME)
    pruned = prune(thing.tables, contacts)
    poses = thing.test(pruned.faces, contacts)
    error = float(contacts.position_error.max())
    hypotheses, weights = cluster(view.model, poses, PoseTolerance(), error)
    kept = bool((poses.faces == view.faces).all(axis=1).any())
    ranked = [hypotheses[index] for index in np.argsort(-weights)]
    return (len(pruned.faces), len(poses), len(hypotheses)), ranked, kept


def memo_noise() -> SensorNoise:
    """The bounds that the memo used."""
    setting = range_setting()
    return noise_of(setting.pi_over, setting.position_error_in)


def generator(seed: int, points: int, trial: int) -> np.random.Generator:
    """Where a trial's placement, view and noise come from."""
    return np.random.default_rng([seed, points, trial])


def _independent(normals: Floats) -> bool:
    """Whether three of the (n, 3) normals are."""
    crosses = np.cross(normals[:, None], normals)
    return bool(np.abs(crosses @ normals.T).max() >= INDEPENDENT)


@cache
def scanning() -> tuple[ProbeScene, Resting, dict[int, RangeScanner]]:
    """The scene, how its object is placed, and a scanner for each number of points."""
    (model,) = load_library([OBJECT_NAME])
    scanners = {
        view.points: RangeScanner(
            memo_noise(),
            width=WIDTH * model.diameter,
            reach=REACH * model.diameter,
            spacing=MEMO_SPACING,
            elevation=ELEVATION,
            points=view.points,
        )
        for view in range_views()
    }
    return ProbeScene(model), Resting(offset=0.0), scanners
