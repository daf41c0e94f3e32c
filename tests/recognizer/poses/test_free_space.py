"""Free space, support and approaches: the truth is never lost, and what is wrong is refuted."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from helpers.sensing import CUBE, L_BLOCK, SMALL, feel, random_pose, touch_faces
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.checker import broken, cone_of
from oracles.geometry import cone_angles, footings, signed_distances, triangle_distances
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.envs.sensors.noise import uniform_in_ball, uniform_in_cone
from palpate.recognizer import (
    Belief,
    Contacts,
    FreeSpace,
    Hypothesis,
    Polygon,
    Polyhedron,
    Recognizer,
    SupportPlane,
)
from palpate.recognizer.contacts.support import stable_faces

Floats = NDArray[np.float64]

APPROACH_ERROR = 0.01
INSIDE = 1.0 - 1e-9
"""As far out as a bound goes, to rounding."""


# The promise: with everything inside its bounds, the truth is never lost


@dataclass(frozen=True, eq=False)
class Scene:
    """An object, where it truly is, and what is known of it, all within bounds."""

    recognizer: Recognizer
    pose: RigidTransform
    contacts: Contacts
    faces: NDArray[np.int32]
    """The true interpretation."""
    free_space: FreeSpace
    support: SupportPlane | None

    @property
    def model(self) -> Polyhedron:
        return self.recognizer.models[0]


@cache
def recognizer_of(name: str, edges: bool = False) -> Recognizer:
    model = SMALL[name] if name in SMALL else oracles.model(name)
    return Recognizer([model], features="all" if edges else "faces")


def within_ball(rng: np.random.Generator, count: int, bound: float, at_bounds: bool) -> Floats:
    shifts = uniform_in_ball(rng, count, bound)
    if at_bounds:
        shifts *= bound * INSIDE / np.linalg.norm(shifts, axis=1, keepdims=True)
    return shifts


def lean(rng: np.random.Generator, directions: Floats, bound: float, at_bounds: bool) -> Floats:
    leaning = uniform_in_cone(rng, directions, bound)
    if at_bounds:
        along = (leaning * directions).sum(axis=1, keepdims=True)
        aside = leaning - along * directions
        aside /= np.linalg.norm(aside, axis=1, keepdims=True)
        leaning = np.cos(bound * INSIDE) * directions + np.sin(bound * INSIDE) * aside
    return leaning


def sweep(model: Polyhedron, start: Floats, along: Floats, radius: float, length: float):
    """How far a ball goes before it touches, and whether it does; None if it grazes.

    No step is longer than the room that is left, so every place of the way has that much.
    """
    gone = np.zeros(len(start))
    room = np.full(len(start), np.inf)
    for _ in range(300):
        moving = (room > 1e-12) & (gone < length)
        if not moving.any():
            break
        places = start[moving] + gone[moving, None] * along[moving]
        room[moving] = signed_distances(model, places) - radius
        gone[moving] += np.maximum(room[moving], 0.0)
    return np.minimum(gone, length), room <= 1e-12, (room <= 1e-12) | (gone >= length)


def touched(
    recognizer: Recognizer, centre: Floats, radius: float
) -> tuple[int, Floats, Floats] | None:
    """The feature that a ball touches, the point of it and its normal there; None if in doubt."""
    model = recognizer.models[0]
    features = recognizer.features(model.name)
    gaps = np.array([triangle_distances(centre[None], oracles.triangles_of(model, f)).min()
                     for f in range(model.face_count)])  # fmt: skip
    heights = model.normals @ centre - model.offsets
    face = int(gaps.argmin())
    if np.count_nonzero(gaps < gaps[face] + 1e-9) == 1 and abs(heights[face] - radius) < 1e-9:
        return face, centre - heights[face] * model.normals[face], model.normals[face]
    if radius == 0.0:
        return None
    # Vertices are behind the edges, and their ends.
    for feature in range(len(features) - 1, model.face_count - 1, -1):
        corners = features.corners[features.start[feature] : features.start[feature + 1]]
        edge = corners[-1] - corners[0]
        share = (centre - corners[0]) @ edge / max(edge @ edge, 1e-300)
        point = corners[0] + np.clip(share, 0.0, 1.0) * edge
        normal = (centre - point) / np.linalg.norm(centre - point)
        reached = abs(np.linalg.norm(centre - point) - radius) < 1e-9
        if reached and cone_angles(normal, cone_of(model, feature, features)) < 1e-6:
            return feature, point, normal
    return None


def settle_down(
    model: Polyhedron, rng: np.random.Generator, resting: bool, error: float, at_bounds: bool
) -> tuple[RigidTransform, SupportPlane]:
    """A pose above a plane, or standing on it, as near to breaking that as the bound allows."""
    up = rng.normal(size=3)
    up /= np.linalg.norm(up)
    share = INSIDE if at_bounds else rng.random()
    pose = random_pose(rng)
    height = 0.0
    if resting:
        faces = footings(model)
        face = faces[rng.integers(len(faces))]
        members, normal = face.corners, face.normal
        flat = np.linalg.svd(members - members.mean(axis=0))[2]
        tilt = np.cos(angle := rng.uniform(0.0, 2.0 * np.pi)) * flat[0] + np.sin(angle) * flat[1]
        extent = np.ptp(members @ tilt)
        turn = np.arcsin(min(0.5, 2.0 * error * share / extent))
        down = np.cos(turn) * normal + np.sin(turn) * tilt
        pose = RigidTransform.from_components(pose.translation, _taking(down, -up, rng))
        heights = pose.apply(members) @ up
        spare = 2.0 * error * INSIDE - np.ptp(heights)
        middle = 0.5 * (heights.min() + heights.max())
        height = middle + rng.uniform(-0.5, 0.5) * max(spare, 0.0)
    else:
        height = float((pose.apply(model.vertices) @ up).min())
        height += error * share if at_bounds else rng.uniform(-3.0, 1.0) * error
    normal = (float(up[0]), float(up[1]), float(up[2]))
    return pose, SupportPlane(height=float(height), error=error, normal=normal, resting=resting)


def _taking(one: Floats, other: Floats, rng: np.random.Generator) -> Rotation:
    """A rotation that takes one direction to another, random about that."""
    first = Rotation.align_vectors(other[None], one[None])[0]
    return Rotation.from_rotvec(rng.uniform(0.0, 2.0 * np.pi) * other) * first


def probe(
    name: str, rng: np.random.Generator, *, edges: bool = False, plane: bool = False,
    resting: bool = False, vague: bool = False, rays: int = 9, most: int = 6,
) -> Scene:  # fmt: skip
    """Probe an object along random rays until it is touched, or missed."""
    recognizer = recognizer_of(name, edges)
    model = recognizer.models[0]
    size = model.diameter
    at_bounds = bool(rng.random() < 1 / 3)
    position_error, path_error = size * 10.0 ** rng.uniform(-2.7, -1.3, 2)
    normal_error = float(rng.choice([1.4, np.pi] if vague else [0.1, 0.25, 0.5]))
    if vague or edges:
        # Contacts that say little leave a great many interpretations soon.
        most = 2 if vague else 4
    if edges:
        normal_error, position_error = 0.1, min(position_error, 0.0025 * size)
    radius = 0.0 if not edges and rng.random() < 0.5 else size * rng.uniform(0.02, 0.2)
    pose, support = random_pose(rng), None
    if plane or resting:
        error = size * rng.uniform(0.002, 0.03)
        if resting:
            # Wider bounds on standing than the narrowest face bears: see below.
            narrowest = min(face.width for face in stable_faces(model))
            error = min(error, 0.24 * narrowest)
        pose, support = settle_down(model, rng, resting, error, at_bounds)
    found: list[tuple[int, Floats, Floats, Floats]] = []
    starts = ends = np.zeros((0, 3))
    sure = np.zeros(0, bool)
    while len(found) < (2 if vague else 3):
        outward = rng.normal(size=(rays, 3))
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        starts = model.centroid + 1.5 * size * outward
        low, high = model.vertices.min(axis=0), model.vertices.max(axis=0)
        aims = rng.uniform(low - 0.15 * size, high + 0.15 * size, (rays, 3))
        along = (aims - starts) / np.linalg.norm(aims - starts, axis=1, keepdims=True)
        gone, hits, sure = sweep(model, starts, along, radius, 3.0 * size)
        ends = starts + gone[:, None] * along
        felt = [touched(recognizer, ends[k], radius) if hits[k] else None for k in range(rays)]
        found = [(*at, along[k]) for k, at in enumerate(felt) if at is not None][:most]
    starts, ends = starts[sure], ends[sure]
    if len(recognizer_of(name).features(name)) == 6:
        # Around a convex solid a ball may slide along a face without end.
        feature, point, normal, _ = found[0]
        aside = rng.normal(size=3)
        normal = model.normals[feature] if feature < model.face_count else normal
        aside -= (aside @ normal) * normal
        starts = np.vstack([starts, point + radius * normal - size * aside])
        ends = np.vstack([ends, point + radius * normal + size * aside])
    turn = pose.rotation
    count = len(found)
    points = pose.apply(np.array([point for _, point, _, _ in found]))
    normals = turn.apply(np.array([normal for _, _, normal, _ in found]))
    ways = turn.apply(np.array([way for _, _, _, way in found]))
    shifts = within_ball(rng, len(starts), path_error, at_bounds)
    if at_bounds and rng.random() < 0.5:
        # All of the path deeper: straight through what it touched, as far as may be.
        shifts[:] = path_error * INSIDE * (ends - starts)
        shifts /= np.linalg.norm(ends - starts, axis=1, keepdims=True)
    other = shifts if rng.random() < 0.5 else within_ball(rng, len(starts), path_error, at_bounds)
    free_space = FreeSpace(
        pose.apply(starts) + shifts, pose.apply(ends) + other, radius=radius, error=path_error
    )
    known = normal_error < np.pi
    contacts = Contacts(
        points + within_ball(rng, count, position_error, at_bounds),
        lean(rng, normals, normal_error, at_bounds) if known else None,
        position_error=position_error,
        normal_error=normal_error if known else None,
        approaches=lean(rng, ways, APPROACH_ERROR, at_bounds)
        if not known or rng.random() < 0.6
        else None,
    )
    faces = np.array([feature for feature, _, _, _ in found], np.int32)
    return Scene(recognizer, pose, contacts, faces, free_space, support)


def holder(belief: Belief, faces: NDArray[np.integer]) -> Hypothesis | None:
    for hypothesis in belief.hypotheses:
        if (hypothesis.interpretations == faces).all(axis=1).any():
            return hypothesis
    return None


def judge(scene: Scene, rng: np.random.Generator, checked: int = 3) -> tuple[list[str], Counter]:
    """What is wrong with the belief in a scene; and counts of what there was to get wrong."""
    model = scene.model
    features = scene.recognizer.features(model.name)
    given = {"free_space": scene.free_space, "support": scene.support}
    known = given | {"features": features}
    # The scene itself is within all bounds, or it would prove nothing.
    wrong = broken(model, scene.pose, scene.contacts, scene.faces, **known)
    wrong = [f"the scene breaks {what}" for what in wrong]
    belief = scene.recognizer.recognize(scene.contacts, **given)
    if belief.complete and holder(belief, scene.faces) is None:
        wrong.append("the truth was lost")
    proven = [hypothesis for hypothesis in belief.hypotheses if hypothesis.proven]
    for row in rng.permutation(len(proven))[:checked]:
        pose, faces = proven[row].pose, proven[row].interpretations[0]
        lacks = broken(model, pose, scene.contacts, faces, **known)
        wrong += [f"a proven pose breaks {what}" for what in lacks]
    counts = Counter(
        scenes=1,
        complete=int(belief.complete),
        hypotheses=len(belief.hypotheses),
        proven=len(proven),
    )
    return wrong, counts


KINDS = {
    "free": {},
    "plane": {"plane": True},
    "standing": {"resting": True},
    "edges": {"edges": True},
    "vague": {"vague": True},
}
NAMES = (*SMALL, "housing", "simple-hand")
every_kind = pytest.mark.parametrize("kind", KINDS)
every_name = pytest.mark.parametrize("name", NAMES)


def campaign(name: str, kind: str, seed: int, cases: int) -> tuple[list[str], Counter]:
    wrong, counts = [], Counter()
    for case in range(cases):
        rng = np.random.default_rng([seed, NAMES.index(name), list(KINDS).index(kind), case])
        lacks, more = judge(probe(name, rng, **KINDS[kind]), rng)
        wrong += [f"case {case}: {what}" for what in lacks]
        counts += more
    return wrong, counts


QUICK = {
    "cube": {"free": 40, "plane": 30, "standing": 15, "edges": 1, "vague": 1},
    "L-block": {"free": 12, "plane": 10, "standing": 25, "edges": 0, "vague": 1},
    "holed": {"free": 20, "plane": 8, "standing": 12, "edges": 0, "vague": 1},
    "housing": {"free": 2, "plane": 0, "standing": 1, "edges": 0, "vague": 0},
}
"""Scenes of the quick run: twenty seconds or so in all."""


@pytest.mark.parametrize(
    ("name", "kind", "cases"),
    [(name, kind, cases) for name in QUICK for kind, cases in QUICK[name].items() if cases],
)
def test_the_truth_is_never_lost_and_what_is_proven_breaks_nothing(
    name: str, kind: str, cases: int
) -> None:
    wrong, counts = campaign(name, kind, seed=1, cases=cases)
    assert wrong == []
    assert counts["complete"] == counts["scenes"] == cases
    assert counts["proven"] > 0.5 * cases or cases < 5


@pytest.mark.slow
@every_kind
@every_name
def test_the_truth_is_never_lost_in_a_long_campaign(name: str, kind: str) -> None:
    cases = {"edges": 15, "vague": 40}.get(kind, 300)
    wrong, _ = campaign(name, kind, seed=2, cases=cases if name in SMALL else cases // 3)
    assert wrong == []


# What is wrong is refuted: cases that one thing alone decides

TIGHT = {"position_error": 2e-4, "normal_error": 0.05}
SHORT = Polyhedron.from_mesh(oracles.box(0.04, 0.04, 0.03), name="short")
TALL = Polyhedron.from_mesh(oracles.box(0.04, 0.04, 0.06), name="tall")
PLATE = Polyhedron.from_mesh(oracles.box(0.06, 0.05, 0.01), name="plate")
TURNED = np.diag([-1.0, -1.0, 1.0])
"""Half a turn about the vertical: what the contacts of `two_ways` leave open."""


def two_ways(motion: RigidTransform) -> Contacts:
    """Contacts that the L-block allows in two ways: its notch at one corner or the opposite one."""
    felt = [
        ([0.00, 0.04, 0.01], [-1, 0, 0]),
        ([0.06, 0.01, 0.02], [1, 0, 0]),
        ([0.05, 0.00, 0.01], [0, -1, 0]),
        ([0.01, 0.05, 0.02], [0, 1, 0]),
        ([0.01, 0.04, 0.00], [0, 0, -1]),
        ([0.05, 0.01, 0.00], [0, 0, -1]),
        ([0.01, 0.045, 0.03], [0, 0, 1]),
    ]
    points, normals = (np.array(column, float) for column in zip(*felt, strict=True))
    return Contacts(motion.apply(points), motion.rotation.apply(normals), **TIGHT)


def ways(belief: Belief, motion: RigidTransform) -> list[bool]:
    """Of each hypothesis, whether it is the block as modelled, and not turned."""
    found = []
    for hypothesis in belief.hypotheses:
        turn = (motion.rotation.inv() * hypothesis.pose.rotation).as_matrix()
        assert min(np.abs(turn - np.eye(3)).max(), np.abs(turn - TURNED).max()) < 0.1
        found.append(bool(np.abs(turn - np.eye(3)).max() < 0.1))
    return found


motions = pytest.mark.parametrize(
    "motion",
    [RigidTransform.identity(), random_pose(np.random.default_rng(5))],
    ids=["here", "there"],
)


@motions
@pytest.mark.parametrize("radius", [0.0, 0.004])
def test_a_path_through_a_notch_tells_which_way_a_block_lies(
    motion: RigidTransform, radius: float
) -> None:
    recognizer, contacts = Recognizer([L_BLOCK]), two_ways(motion)
    assert sorted(ways(recognizer.recognize(contacts), motion)) == [False, True]
    for x, y, way in ((0.05, 0.04, True), (0.01, 0.01, False)):
        path = FreeSpace(
            motion.apply([[x, y, -0.1]]), motion.apply([[x, y, 0.1]]), radius=radius, error=5e-4
        )
        belief = recognizer.recognize(contacts, free_space=path)
        assert ways(belief, motion) == [way]
        assert belief.hypotheses[0].proven
    # Through both corners, no way is left; past the block, both are.
    both = motion.apply([[0.0, 0.0, 0.01], [-0.1, -0.1, 0.01]])
    through = FreeSpace(both[:1] + 0.0, motion.apply([[0.07, 0.06, 0.01]]), error=5e-4)
    assert recognizer.recognize(contacts, free_space=through).empty
    past = FreeSpace(both[1:], motion.apply([[0.1, -0.1, 0.01]]), radius=radius, error=5e-4)
    belief = recognizer.recognize(contacts, free_space=past)
    assert sorted(ways(belief, motion)) == [False, True]
    assert all(hypothesis.proven for hypothesis in belief.hypotheses)


@motions
def test_a_ball_is_refuted_where_the_line_of_its_middle_is_not(motion: RigidTransform) -> None:
    recognizer, contacts = Recognizer([L_BLOCK]), two_ways(motion)
    starts, ends = motion.apply([[0.025, 0.04, -0.1]]), motion.apply([[0.025, 0.04, 0.1]])
    for radius, left in ((0.0, [True]), (0.004, [True]), (0.007, [])):
        path = FreeSpace(starts, ends, radius=radius, error=1e-3)
        assert ways(recognizer.recognize(contacts, free_space=path), motion) == left


@motions
def test_the_end_of_a_path_tells_how_long_an_object_is(motion: RigidTransform) -> None:
    recognizer = Recognizer([CUBE, TALL])
    sides = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1.0]])
    points = np.array([0.02, 0.02, 0.02]) + 0.02 * sides
    contacts = Contacts(motion.apply(points), motion.rotation.apply(sides), **TIGHT)

    def names(end: float) -> set[str]:
        path = FreeSpace(
            motion.apply([[0.02, 0.02, 0.2]]), motion.apply([[0.02, 0.02, end]]), error=1e-3
        )
        belief = recognizer.recognize(contacts, free_space=path)
        return {hypothesis.object_name for hypothesis in belief.hypotheses}

    assert names(0.062) == {"cube", "tall"}
    assert names(0.05) == {"cube"}
    assert names(0.03) == set()


@motions
def test_a_support_plane_tells_which_way_a_block_lies(motion: RigidTransform) -> None:
    recognizer, contacts = Recognizer([L_BLOCK]), two_ways(motion)
    for corner, way in (([0.0, 0.0, 0.01], False), ([0.06, 0.05, 0.01], True)):
        inwards = np.array([0.03, 0.025, 0.01]) - corner
        inwards /= np.linalg.norm(inwards)
        up = motion.rotation.apply(inwards)
        height = float(motion.apply(corner) @ up) + 0.004
        support = SupportPlane(height=height, error=1e-3, normal=(up[0], up[1], up[2]))
        belief = recognizer.recognize(contacts, support=support)
        assert ways(belief, motion) == [way]
        assert belief.hypotheses[0].proven
        low = SupportPlane(height=height - 0.01, error=1e-3, normal=(up[0], up[1], up[2]))
        assert sorted(ways(recognizer.recognize(contacts, support=low), motion)) == [False, True]


@motions
@pytest.mark.parametrize("error", [5e-4, 0.003, 0.006])
def test_standing_tells_a_block_from_one_that_would_float_or_sink(
    motion: RigidTransform, error: float
) -> None:
    recognizer = Recognizer([CUBE, TALL, SHORT])
    sides = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, 1.0]])
    points = np.array([0.02, 0.02, 0.03]) + sides * [0.02, 0.02, 0.01]
    contacts = Contacts(motion.apply(points), motion.rotation.apply(sides), **TIGHT)
    up = motion.rotation.apply([0.0, 0.0, 1.0])
    height = float(motion.translation @ up)

    def names(resting: bool) -> set[str]:
        support = SupportPlane(
            height=height, error=error, normal=(up[0], up[1], up[2]), resting=resting
        )
        belief = recognizer.recognize(contacts, support=support)
        return {hypothesis.object_name for hypothesis in belief.hypotheses}

    assert {h.object_name for h in recognizer.recognize(contacts).hypotheses} == {
        "cube", "tall", "short"}  # fmt: skip
    assert names(resting=False) == {"cube", "short"}
    assert names(resting=True) == {"cube"}


def test_the_truth_stands_on_a_plane_known_so_badly_that_it_says_little() -> None:
    model = SMALL["L-block"]
    recognizer = recognizer_of("L-block")
    for case in range(10):
        rng = np.random.default_rng([11, case])
        pose, support = settle_down(model, rng, True, 0.25 * model.diameter, case % 3 == 0)
        touches = touch_faces(model, rng, rng.integers(model.face_count, size=5).tolist(), pose)
        contacts = feel(touches, rng, 2e-4, 0.1, at_bounds=case % 3 == 0)
        belief = recognizer.recognize(contacts, support=support)
        assert holder(belief, touches.faces) is not None


@pytest.mark.parametrize("error", [0.008, 0.009])
def test_a_pose_that_does_not_stand_is_not_proven_however_wide_the_bound(error: float) -> None:
    """Its sides are 30 millimetres wide: a face that may be 8 off says nothing of its plane."""
    sides = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, 1.0]])
    points = np.array([0.02, 0.02, 0.03]) + sides * [0.02, 0.02, 0.01]
    contacts = Contacts(points, sides, **TIGHT)
    support = SupportPlane(error=error, resting=True)
    belief = Recognizer([SHORT]).recognize(contacts, support=support)
    for hypothesis in belief.hypotheses:
        faces = hypothesis.interpretations[0]
        lacks = broken(SHORT, hypothesis.pose, contacts, faces, support=support)
        assert not hypothesis.proven or lacks == []


@motions
def test_an_object_on_its_edge_does_not_stand(motion: RigidTransform) -> None:
    """Turned by an eighth it is above the plane and touches it, on no face."""
    up = motion.rotation.apply(np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0))
    sides = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, 1.0], [0, 0, -1]])
    contacts = Contacts(motion.apply(0.02 + 0.02 * sides), motion.rotation.apply(sides), **TIGHT)
    height = float(motion.translation @ up)
    for resting in (False, True):
        support = SupportPlane(
            height=height, error=1e-3, normal=(up[0], up[1], up[2]), resting=resting
        )
        belief = Recognizer([CUBE]).recognize(contacts, support=support)
        assert belief.empty == resting


@motions
def test_where_the_probe_came_from_tells_on_which_side_of_its_contacts_a_plate_is(
    motion: RigidTransform,
) -> None:
    points = [[0, 0.02, 0], [0.06, 0.03, 0], [0.02, 0, 0], [0.04, 0.05, 0], [0.02, 0.03, 0]]
    felt = motion.apply(points)
    sides = motion.rotation.apply([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]])
    normals = np.vstack([sides, np.full(3, np.nan)])
    recognizer = Recognizer([PLATE])
    left = []
    for along in (None, [0, 0, -1], [0, 0, 1]):
        approaches = None if along is None else np.full((5, 3), np.nan)
        if approaches is not None:
            approaches[4] = motion.rotation.apply(along)
        contacts = Contacts(
            felt, normals, position_error=2e-4, normal_error=0.05, approaches=approaches
        )
        belief = recognizer.recognize(contacts)
        assert belief.complete
        middles = [h.pose.apply(PLATE.centroid) for h in belief.hypotheses]
        left.append(sorted(round(float(motion.inv().apply(m)[2]), 3) for m in middles))
    assert left == [[-0.005, 0.005], [-0.005], [0.005]]


@motions
def test_an_approach_refutes_a_normal_that_leans_away_from_it(motion: RigidTransform) -> None:
    """The bound on the normal alone would let it turn; the approach cuts that part off."""
    turned = Rotation.from_rotvec([0.0, 0.3, 0.0]).apply([0.0, 0.0, 1.0])
    for sine, empty in ((0.5, True), (-0.2, False)):
        # The way leans off the true normal's plane, to behind the surface or to in front of it.
        along = np.array([np.sqrt(1.0 - sine**2), 0.0, sine])
        contacts = Contacts(
            motion.apply([[0.02, 0.02, 0.04]]),
            motion.rotation.apply(turned[None]),
            position_error=2e-4,
            normal_error=0.31,
            approaches=motion.rotation.apply(along[None]),
        )
        # The rest of the cone faces it only for a normal that leans the other way.
        belief = Recognizer([CUBE]).recognize(contacts)
        least = np.arccos(np.clip(turned @ -along, -1.0, 1.0)) - 0.31
        assert (least > np.pi / 2.0 + APPROACH_ERROR) == empty == belief.empty


# Knowledge in parts


@pytest.mark.parametrize("kind", ["free", "plane", "standing"])
@pytest.mark.parametrize("name", list(SMALL))
def test_knowledge_in_parts_leaves_the_same_as_all_at_once(name: str, kind: str) -> None:
    compared = 0
    for case in range(3):
        rng = np.random.default_rng([7, NAMES.index(name), list(KINDS).index(kind), case])
        scene = probe(name, rng, **KINDS[kind])
        contacts, paths = scene.contacts, scene.free_space
        cuts = sorted(rng.integers(len(contacts) // 2 + 1, len(contacts) + 1, 2))
        rows = [slice(0, cuts[0]), slice(cuts[0], cuts[1]), slice(cuts[1], None)]
        places = np.array_split(rng.permutation(len(paths)), len(rows))
        parts = [
            FreeSpace(
                paths.starts[row], paths.ends[row], radius=paths.radius[row], error=paths.error[row]
            )
            for row in places
        ]
        belief = scene.recognizer.recognize(
            contacts[rows[0]], free_space=parts[0], support=scene.support
        )
        for row, part in zip(rows[1:], parts[1:], strict=True):
            belief = scene.recognizer.update(belief, contacts[row], free_space=part)
        whole = scene.recognizer.recognize(
            contacts, free_space=FreeSpace.join(parts), support=scene.support
        )
        assert len(belief.contacts) == len(contacts)
        np.testing.assert_array_equal(belief.free_space.starts, whole.free_space.starts)
        assert belief.support is scene.support
        assert holder(belief, scene.faces) is not None
        if not (belief.complete and whole.complete):
            continue
        one, other = (
            {
                (h.object_name, *row)
                for h in each.hypotheses
                if h.proven
                for row in h.interpretations.tolist()
            }
            for each in (belief, whole)
        )
        every = [
            {(h.object_name, *row) for h in each.hypotheses for row in h.interpretations.tolist()}
            for each in (belief, whole)
        ]
        # What stays undecided may differ by where the work began; what has a witness may not.
        assert one <= every[1]
        assert other <= every[0]
        compared += int(every[0] == every[1])
    assert compared >= 2


def test_free_space_alone_can_follow_the_contacts() -> None:
    motion = random_pose(np.random.default_rng(8))
    recognizer = Recognizer([L_BLOCK])
    belief = recognizer.recognize(two_ways(motion))
    path = FreeSpace(
        motion.apply([[0.05, 0.04, -0.1]]), motion.apply([[0.05, 0.04, 0.1]]), error=5e-4
    )
    later = recognizer.update(belief, Contacts.none(), free_space=path)
    assert sorted(ways(belief, motion)) == [False, True]
    assert ways(later, motion) == [True]
    assert len(later.free_space) == 1
    assert ways(recognizer.update(later, Contacts.none()), motion) == [True]


def test_nothing_known_besides_changes_nothing() -> None:
    contacts = two_ways(random_pose(np.random.default_rng(9)))
    recognizer = Recognizer([L_BLOCK])
    one = recognizer.recognize(contacts)
    other = recognizer.recognize(contacts, free_space=FreeSpace.none())
    for a, b in zip(one.hypotheses, other.hypotheses, strict=True):
        assert a.pose.as_matrix().tobytes() == b.pose.as_matrix().tobytes()
        assert a.weight == b.weight


def test_a_stray_contact_does_not_hide_behind_free_space() -> None:
    motion = random_pose(np.random.default_rng(10))
    good = two_ways(motion)
    stray = Contacts(motion.apply([[0.2, 0.2, 0.2]]), [[0.0, 0.0, 1.0]], **TIGHT)
    path = FreeSpace(
        motion.apply([[0.05, 0.04, -0.1]]), motion.apply([[0.05, 0.04, 0.1]]), error=5e-4
    )
    contacts = Contacts.join([good, stray])
    recognizer = Recognizer([L_BLOCK])
    assert recognizer.recognize(contacts, free_space=path).empty
    belief = recognizer.recognize(contacts, outliers=1, free_space=path)
    best = [h for h in belief.hypotheses if (h.interpretations == -1).sum(axis=1).min() == 1]
    assert best
    for hypothesis in best:
        assert (hypothesis.interpretations[:, -1] == -1).all()
        turn = (motion.rotation.inv() * hypothesis.pose.rotation).as_matrix()
        np.testing.assert_allclose(turn, np.eye(3), atol=0.1)


# Paths


def test_paths_are_joined_in_order_and_know_their_clearance() -> None:
    one = FreeSpace([[0, 0, 0]], [[1, 0, 0]], radius=0.25, error=0.125)
    two = FreeSpace([[0, 1, 0]] * 2, [[1, 1, 0]] * 2, error=[0.5, 1.0])
    both = FreeSpace.join([one, FreeSpace.none(), two])
    assert len(both) == 3
    np.testing.assert_array_equal(both.clearance, [0.125, -0.5, -1.0])
    np.testing.assert_array_equal(both.starts[:, 1], [0, 1, 1])
    assert len(FreeSpace.join([])) == len(FreeSpace.none()) == 0


def test_paths_share_no_memory_and_can_not_be_written() -> None:
    starts = np.zeros((1, 3))
    paths = FreeSpace(starts, np.ones((1, 3)), error=1.0)
    starts[:] = 7.0
    assert not paths.starts.any()
    for values in (paths.starts, paths.ends, paths.radius, paths.error):
        with pytest.raises(ValueError, match="read-only"):
            values[:] = 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"starts": [0, 0, 0]}, r"starts must have shape \(m, 3\), not \(3,\)"),
        ({"starts": [[0, 0]]}, r"starts must have shape \(m, 3\), not \(1, 2\)"),
        ({"ends": [[0, 0, 0, 0]]}, r"ends must have shape \(m, 3\), not \(1, 4\)"),
        ({"starts": [[0, np.nan, 0]]}, r"starts: row 0 is \[0.0, nan, 0.0\]; it must be finite"),
        ({"ends": [[0, 0, -np.inf]]}, r"ends: row 0 is \[0.0, 0.0, -inf\]; it must be finite"),
        ({"ends": [[0, 0, 0]] * 2}, r"1 starts but 2 ends: give one end a start"),
        ({"radius": -1e-3}, r"radius: row 0 is -0.001; it must be zero or more"),
        ({"radius": np.nan}, r"radius: row 0 is nan; it must be zero or more"),
        ({"radius": [0.0, 0.0]}, r"radius must be one number or have shape \(1,\), not \(2,\)"),
        ({"error": 0.0}, r"error: row 0 is 0; it must be above zero"),
        ({"error": [-1.0]}, r"error: row 0 is -1; it must be above zero"),
        ({"error": np.inf}, r"error: row 0 is inf"),
        ({"error": [[1.0]]}, r"error must be one number or have shape \(1,\), not \(1, 1\)"),
    ],
)
def test_what_cannot_be_a_path_is_refused_with_a_reason(change: dict, message: str) -> None:
    values = {"starts": [[0, 0, 0]], "ends": [[1, 0, 0]], "radius": 0.0, "error": 1e-3} | change
    with pytest.raises(ValueError, match=message):
        FreeSpace(values["starts"], values["ends"], radius=values["radius"], error=values["error"])


def test_the_path_at_fault_is_named() -> None:
    with pytest.raises(ValueError, match="error: row 2 is 0"):
        FreeSpace(np.zeros((3, 3)), np.ones((3, 3)), error=[1.0, 1.0, 0.0])


@pytest.mark.parametrize("known", ["free_space", "support"])
def test_outlines_of_the_plane_take_neither_free_space_nor_a_support(known: str) -> None:
    outline = Polygon.from_corners([[0, 0], [0.04, 0], [0.04, 0.03]], name="corner")
    contacts = Contacts([[0.02, 0.0]], [[0.0, -1.0]], **TIGHT)
    recognizer = Recognizer([outline])
    given = {
        "free_space": {"free_space": FreeSpace.none()},
        "support": {"support": SupportPlane(error=1e-3)},
    }[known]
    with pytest.raises(ValueError, match="free space and support are for solids"):
        recognizer.recognize(contacts, **given)
    belief = recognizer.recognize(contacts)
    with pytest.raises(ValueError, match=r"free space .* for solids"):
        recognizer.update(belief, contacts, free_space=FreeSpace.none())
