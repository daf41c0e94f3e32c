"""The cover of all poses: none that the contacts allow is outside it."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.sensing import INCH, SMALL, feel, forget_normals, touch_faces
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.checker import check
from oracles.samples import draw
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts, Hypothesis, Polyhedron, Recognizer
from palpate.recognizer.poses.component_kernels import link_leaves
from palpate.recognizer.poses.cover import Aims, Cover, Leaves, problem_of, search_cover
from palpate.recognizer.poses.entry import SolidEntry, bit_set
from palpate.recognizer.tree.tree import Constraints

Floats = NDArray[np.float64]
CASES = 200
ROUNDING = 1e-9

CORNERS = [
    (0.308321, 0.158515, -0.172086),
    (0.187101, -0.206522, 0.165157),
    (0.337212, 0.139110, -0.212374),
    (-0.035360, 0.074573, -0.395085),
    (0.373543, -0.022684, -0.197777),
    (-0.263358, -0.012421, -0.289687),
]
"""Six places on a regular tetrahedron, known to 2 mm."""
FORGOTTEN = RigidTransform.from_components(
    [0.0966, 0.0545, -0.1766],
    Rotation.from_matrix(
        [[-0.7167, -0.6961, -0.0417], [-0.609, 0.6539, -0.4488], [0.3397, -0.2963, -0.8927]]
    ),
)
"""A pose that explains them; another, far from it, has them on the same faces."""


def cover_of(
    entry: SolidEntry,
    contacts: Contacts,
    spare: int = 0,
    nodes: int = 20_000,
    faces: NDArray[np.integer] | None = None,
) -> Cover:
    """The cover of all poses, over all features or those of one interpretation."""
    largest = float(contacts.position_error.max()) / entry.shape.radius
    turns = 3 if (contacts.normal_error > 1.0).all() else 0
    aims = Aims(spare, max(5.0 * largest, 0.1), turns, 0.05, max(0.02, 2.0 * largest))
    problem = problem_of(
        entry.shape, entry.kernel.model, entry.packed, contacts, Constraints().bits, aims
    )
    domains = entry.by_kind[contacts.kinds]
    if faces is not None:
        domains = np.array([bit_set(faces[[i]], len(entry.features)) for i in range(len(faces))])
    return search_cover(problem, domains, most_nodes=nodes, most_found=100_000)


def holding(leaves: Leaves, contacts: Contacts, radius: float, pose: RigidTransform) -> list[int]:
    """The leaves whose boxes a pose is in, worked out from what a box is."""
    inverse = pose.rotation.inv()
    shift = inverse.apply(contacts.positions.mean(axis=0) - pose.translation) / radius
    turns = Rotation.from_matrix(leaves.charts).inv() * inverse
    angles = np.maximum(turns.magnitude(), 1e-300)[:, None]
    gibbs = np.tan(angles / 2.0) * turns.as_rotvec() / angles
    inside = (leaves.lows - ROUNDING <= gibbs) & (gibbs <= leaves.highs + ROUNDING)
    inside &= (leaves.rooms[..., 0] - ROUNDING <= shift) & (
        shift <= leaves.rooms[..., 1] + ROUNDING
    )
    return np.flatnonzero(inside.all(axis=1)).tolist()


def test_the_true_pose_is_in_a_leaf_of_the_true_interpretation() -> None:
    rng = np.random.default_rng(11)
    whole, entries = 0, {}
    for case in range(CASES):
        sample = draw(rng, fewest=3, most=12)
        nulls = int((sample.faces < 0).sum())
        if nulls > 1 or len(sample.faces) - nulls < 3:
            continue
        key = (sample.model.name, len(sample.features))
        edges = len(sample.features) > sample.model.face_count
        entry = entries.setdefault(key, SolidEntry.of(sample.model, edges=edges, folder=None))
        cover = cover_of(entry, sample.contacts, nulls, nodes=3_000)
        if not cover.complete:
            continue
        whole += 1
        rows = holding(cover.leaves, sample.contacts, sample.model.diameter / 2.0, sample.truth)
        named = np.maximum(cover.leaves.fixed[rows], -1)
        assert (named == sample.faces).all(axis=1).any(), f"case {case}: the truth was lost"
    assert whole > CASES / 5


def test_what_is_proven_meets_its_bounds() -> None:
    rng = np.random.default_rng(12)
    proven = 0
    for name in SMALL:
        entry = SolidEntry.of(SMALL[name], edges=False, folder=None)
        for case in range(15):
            faces = rng.integers(entry.model.face_count, size=6).tolist()
            touches = touch_faces(entry.model, rng, faces)
            contacts = feel(touches, rng, 0.02 * INCH, np.pi / 10, at_bounds=case % 2 == 0)
            leaves = cover_of(entry, contacts).leaves
            for row in np.flatnonzero(leaves.proven):
                pose = RigidTransform.from_components(
                    leaves.translations[row], Rotation.from_matrix(leaves.rotations[row])
                )
                assert check(entry.model, pose, contacts, leaves.fixed[row]).passed
                proven += 1
    assert proven > 100


def fit(
    model: Polyhedron, contacts: Contacts, faces: NDArray[np.integer], start: Floats
) -> RigidTransform:
    """A pose near a start that breaks the bounds as little as it may, by SciPy's least squares."""

    def pose_of(z: Floats) -> RigidTransform:
        return RigidTransform.from_components(z[3:], Rotation.from_rotvec(z[:3]))

    def excess(z: Floats) -> Floats:
        found = check(model, pose_of(z), contacts, faces)
        places = np.maximum(found.distances / contacts.position_error - 0.98, 0.0)
        known = contacts.normal_error < 3.0
        leans = np.maximum(found.angles / contacts.normal_error - 0.98, 0.0)
        return np.concatenate([places, leans[known], [0.0] * 6])

    return pose_of(least_squares(excess, start, max_nfev=30).x)


@pytest.mark.parametrize("name", ["tetrahedron", "L-block", "cube"])
def test_poses_found_by_another_search_are_in_the_cover(name: str) -> None:
    rng = np.random.default_rng(13)
    model = SMALL[name] if name in SMALL else oracles.model(name)
    entry = SolidEntry.of(model, edges=False, folder=None)
    met = 0
    for case in range(3):
        touches = touch_faces(model, rng, rng.integers(model.face_count, size=5).tolist())
        contacts = feel(touches, rng, 0.02 * model.diameter, np.pi / 8, at_bounds=case == 0)
        contacts = forget_normals(contacts, np.arange(5) >= case)
        faces = touches.faces
        cover = cover_of(entry, contacts, nodes=200_000, faces=faces)
        assert cover.complete
        for _ in range(12):
            turn = touches.T_world_object.rotation
            if rng.random() < 0.7:
                turn = Rotation.random(rng=rng)
            middle = turn.apply(model.centroid.copy())
            at = (
                contacts.positions.mean(axis=0) - middle + 0.1 * rng.normal(size=3) * model.diameter
            )
            pose = fit(model, contacts, faces, np.concatenate([turn.as_rotvec(), at]))
            if not check(model, pose, contacts, faces, tolerance=0.0).passed:
                continue
            met += 1
            rows = holding(cover.leaves, contacts, entry.shape.radius, pose)
            assert (cover.leaves.fixed[rows] == faces).all(axis=1).any()
    assert met >= 3


def nearest_turn(model: Polyhedron, hypothesis: Hypothesis, pose: RigidTransform) -> float:
    """The least turn from a hypothesis's pose to another, up to the solid's symmetries."""
    between = hypothesis.pose.rotation.inv() * pose.rotation
    return float((between * Rotation.from_matrix(model.symmetries)).magnitude().min())


def test_a_pose_that_no_way_connects_to_the_others_is_a_hypothesis() -> None:
    model = oracles.model("tetrahedron")
    contacts = Contacts(CORNERS, np.full((6, 3), np.nan), position_error=0.002, normal_error=np.pi)
    belief = Recognizer([model]).recognize(contacts)
    assert belief.complete
    assert not belief.unique
    near = [h for h in belief.hypotheses if nearest_turn(model, h, FORGOTTEN) < np.radians(4.0)]
    assert near
    assert any(nearest_turn(model, h, FORGOTTEN) <= h.farthest_turn + ROUNDING for h in near)


def test_poses_that_are_known_are_no_farther_than_a_hypothesis_says() -> None:
    rng = np.random.default_rng(14)
    model = SMALL["L-block"]
    recognizer = Recognizer([model])
    for case in range(40):
        touches = touch_faces(model, rng, rng.integers(model.face_count, size=7).tolist())
        contacts = feel(touches, rng, 0.05 * INCH, np.pi / 8, at_bounds=case % 3 == 0)
        truth, centre = touches.T_world_object, model.centroid.copy()
        belief = recognizer.recognize(contacts)
        assert any(
            nearest_turn(model, h, truth) <= h.farthest_turn + ROUNDING
            and np.linalg.norm(h.pose.apply(centre) - truth.apply(centre))
            <= h.farthest_shift + ROUNDING
            and (h.interpretations == touches.faces).all(axis=1).any()
            for h in belief.hypotheses
        ), case


@pytest.mark.parametrize("name", ["tetrahedron", "cube"])
def test_a_symmetric_solid_keeps_every_piece_of_an_interpretations_poses(name: str) -> None:
    """Positions alone: an interpretation often has poses in several pieces."""
    rng = np.random.default_rng(15)
    model = oracles.model(name)
    recognizer, reach = Recognizer([model]), 0.01 * model.diameter
    for case in range(40):
        touches = touch_faces(model, rng, rng.integers(model.face_count, size=4).tolist())
        contacts = forget_normals(feel(touches, rng, reach, 0.3), np.ones(4, bool))
        truth, centre = touches.T_world_object, model.centroid
        assert any(
            nearest_turn(model, h, truth) <= h.farthest_turn + ROUNDING
            and np.linalg.norm(h.pose.apply(centre) - truth.apply(centre))
            <= h.farthest_shift + ROUNDING
            and (h.interpretations == touches.faces).all(axis=1).any()
            for h in recognizer.recognize(contacts)
        ), case


def test_leaves_are_one_component_only_if_a_way_leads_from_box_to_box() -> None:
    def boxes(places: list[tuple[float, float]], witnesses: list[tuple[float, float]]) -> Leaves:
        count = len(places)
        room = np.zeros((count, 3, 2))
        room[:, :, 1] = 1.0
        room[:, 0] = [(first, first + 1.0) for first, _ in places]
        turns = np.array([(turn, 0.0, 0.0) for _, turn in places])
        angles = np.array([(2.0 * np.arctan(turn), 0.0, 0.0) for _, turn in witnesses])
        shifts = np.array([(first + 0.5, 0.5, 0.5) for first, _ in witnesses])
        inverses = Rotation.from_rotvec(angles)
        return Leaves(
            fixed=np.zeros((count, 1), np.int32),
            charts=np.tile(np.eye(3), (count, 1, 1)),
            lows=turns - 0.1,
            highs=turns + 0.1,
            rooms=room,
            rotations=inverses.inv().as_matrix(),
            translations=-inverses.inv().apply(shifts),
            proven=np.ones(count, bool),
        )

    def linked(
        places: list[tuple[float, float]],
        interpretations: list[int],
        witnesses: list[tuple[float, float]] | None = None,
    ) -> list[int]:
        leaves = boxes(places, witnesses or places)
        return link_leaves(leaves, np.array(interpretations), np.zeros(3), 1.0)[0].tolist()

    row = [(0.0, 0.0), (0.5, 0.0), (1.2, 0.15), (0.0, 0.9)]
    assert linked(row, [0, 0, 0, 0]) == [0, 0, 0, 1]
    assert linked(row, [0, 1, 0, 0]) == [0, 1, 2, 3]
    assert linked(row[::-1], [0, 0, 0, 0]) == [0, 1, 1, 1]
    # The last one's witness lies in the first box.
    assert linked(row, [0, 0, 0, 0], [*row[:3], (0.1, 0.05)]) == [0, 0, 0, 0]
    assert linked(row, [0, 0, 0, 1], [*row[:3], (0.1, 0.05)]) == [0, 0, 0, 1]
