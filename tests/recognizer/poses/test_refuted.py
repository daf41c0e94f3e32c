"""What is wrong is refuted: cases that free space, a support or an approach alone decides."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.sensing import CUBE, L_BLOCK
from helpers.two_ways import TIGHT, motions, two_ways, ways
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.checker import broken
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts, FreeSpace, Polyhedron, Recognizer, SupportPlane

Floats = NDArray[np.float64]
APPROACH_ERROR = 0.01
SHORT = Polyhedron.from_mesh(oracles.box(0.04, 0.04, 0.03), name="short")
TALL = Polyhedron.from_mesh(oracles.box(0.04, 0.04, 0.06), name="tall")
PLATE = Polyhedron.from_mesh(oracles.box(0.06, 0.05, 0.01), name="plate")


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


@pytest.mark.parametrize(
    ("error", "stands"), [(0.008, False), (0.009, False), (0.0097, False), (0.0101, True)]
)
def test_a_pose_that_does_not_stand_is_not_proven_however_wide_the_bound(
    error: float, stands: bool
) -> None:
    """Its sole is 10 millimetres off: so wide a bound says nothing of planes 30 wide."""
    sides = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, 1.0]])
    points = np.array([0.02, 0.02, 0.03]) + sides * [0.02, 0.02, 0.01]
    contacts = Contacts(points, sides, **TIGHT)
    support = SupportPlane(error=error, resting=True)
    belief = Recognizer([SHORT]).recognize(contacts, support=support)
    proven = [hypothesis for hypothesis in belief.hypotheses if hypothesis.proven]
    assert bool(proven) == stands
    for hypothesis in proven:
        faces = hypothesis.interpretations[0]
        assert broken(SHORT, hypothesis.pose, contacts, faces, support=support) == []


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
