"""A session with a real probe: what is suggested, what is predicted of it, and what it achieves."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from helpers.beliefs import interpretations_of
from oracles.solids import (
    as_set,
    blocks,
    box,
    first_hit,
    model,
    noisy_contacts,
    random_contacts,
    random_pose,
    surface_points,
)
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.policies.outcomes.outcomes import Outcomes
from palpate.policies.outcomes.reports import Purpose, Report, Suggestion, reports_of
from palpate.policies.outcomes.task import Task
from palpate.policies.ranking import FORMULAS
from palpate.policies.session import Session
from palpate.policies.straight import AXES, Reach, Region
from palpate.recognizer import (
    Belief,
    Contacts,
    FreeSpace,
    Polygon,
    Polyhedron,
    SupportPlane,
)
from palpate.recognizer.predict.prediction import MET_OBJECT, Predictions, samples_of
from palpate.recognizer.predict.probes import ProbeSpace, TriadRays

LIBRARY = [model("l-block"), model("tetrahedron"), Polyhedron.from_mesh(box(1, 2, 3), name="box")]
REACH, CONE = 0.01, 0.3
LONGER = Polyhedron.from_mesh(
    blocks([[[1], [1]], [[1], [0]]], [0, 1, 2.56], [0, 0.7, 3], [0, 1.3]), name="longer"
)
TWINS = [model("l-block"), LONGER]
"""They differ by how long an arm is."""


def begun(seed: int, count: int, **known) -> tuple[Session, RigidTransform, list[int]]:
    """A session after touches of the l-block at some pose, and the faces that they are truly on."""
    rng = np.random.default_rng(seed)
    pose = random_pose(rng, 2.0)
    contacts, faces = random_contacts(
        LIBRARY[0], pose, count, rng, position_error=REACH, normal_error=CONE
    )
    session = Session(LIBRARY, **known)
    session.add(contacts)
    return session, pose, faces.tolist()


def met(solid: Polyhedron, pose: RigidTransform, start, direction) -> tuple[float, int]:
    """Depth and face at which a line first meets a solid, triangle by triangle."""
    triangles = pose.apply(solid.vertices)[solid.triangles]
    depth, triangle = first_hit(triangles, start, direction)
    return depth, int(solid.triangle_faces[triangle]) if triangle >= 0 else -1


def touch_as_suggested(one: Suggestion, pose: RigidTransform, rng: np.random.Generator):
    """What a touch of the l-block reports: contacts, free space and the face it is truly on."""
    start, direction = one.start_world, one.direction_world
    depth, face = met(LIBRARY[0], pose, start, direction)
    if depth > one.length:
        return Contacts.none(), FreeSpace(start[None], one.end_world[None], error=REACH), []
    point = start + depth * direction
    normal = pose.rotation.apply(LIBRARY[0].normals[face].copy())
    contacts = noisy_contacts(
        point[None], normal[None], rng, position_error=REACH, normal_error=CONE
    )
    return contacts, FreeSpace(start[None], contacts.positions, error=REACH), [face]


def holds(belief: Belief | None, faces: list[int]) -> bool:
    """Whether the true faces are among the interpretations of the l-block."""
    assert belief is not None
    own = [one.interpretations for one in belief.hypotheses if one.object_name == "l-block"]
    return bool(own) and tuple(faces) in as_set(np.concatenate(own))


def agrees(report: Report, one: Suggestion, solid: Polyhedron, pose: RigidTransform) -> bool:
    """Whether a ray cast at a pose, triangle by triangle, meets what a report says."""
    depth, face = met(solid, pose, one.start_world, one.direction_world)
    if not report.touches:
        return depth > one.length
    least, most = report.depths
    # Between what the likeliest of them feels and any other there is no more than two cones.
    leaning = pose.rotation.apply(solid.normals[face].copy()) @ report.normal_world
    return least - 1e-5 <= depth <= most + 1e-5 and leaning > np.cos(2.0 * CONE + 0.1)


@cache
def ambiguous(seed: int) -> tuple[Session, Belief]:
    """A session with the twins left, each at one pose: only the arm's end isn't touched."""
    rng, solid = np.random.default_rng(seed), TWINS[0]
    points, faces = surface_points(solid, 200, rng)
    end = np.flatnonzero((solid.normals[:, 0] > 0.9) & (solid.offsets > 2.4))
    others = [face for face in range(solid.face_count) if face not in end]
    rows = np.concatenate([np.flatnonzero(faces == face)[:2] for face in others])
    pose = random_pose(rng, 2.0)
    contacts = noisy_contacts(
        pose.apply(points[rows]),
        pose.rotation.apply(solid.normals[faces[rows]]),
        rng,
        position_error=0.3 * REACH,
        normal_error=CONE,
    )
    session = Session(TWINS)
    belief = session.add(contacts)
    assert belief is not None
    assert {one.object_name for one in belief.hypotheses} == {"l-block", "longer"}
    assert all(one.determined for one in belief.hypotheses)
    return session, belief


@pytest.mark.parametrize("seed", range(6))
def test_what_rivals_are_said_to_report_is_what_rays_cast_at_them_meet(seed):
    session, belief = ambiguous(seed)
    named = session.suggest(4)
    assert len(named) == 4
    for one in named:
        said = [
            (report, rival, k)
            for report in one.reports
            for rival in report.rivals
            for k in rival.hypotheses
        ]
        assert sorted(k for _, _, k in said) == list(range(len(belief.hypotheses)))
        for report, rival, k in said:
            hypothesis = belief.hypotheses[k]
            assert hypothesis.object_name == rival.object_name
            solid = next(part for part in TWINS if part.name == rival.object_name)
            assert agrees(report, one, solid, hypothesis.pose)


@pytest.mark.parametrize("seed", range(6))
def test_the_weights_of_rivals_are_the_chances_of_their_reports(seed):
    session, belief = ambiguous(seed)
    named = session.suggest(3)
    assert len(named) == 3
    for one in named:
        assert sum(report.chance for report in one.reports) == pytest.approx(1.0)
        for report in one.reports:
            weight = sum(belief.hypotheses[k].weight for r in report.rivals for k in r.hypotheses)
            assert report.chance == pytest.approx(weight)
            assert report.chance == pytest.approx(sum(rival.chance for rival in report.rivals))


def test_what_is_felt_as_said_leaves_the_rivals_that_said_so_alone():
    told_apart = 0
    for seed in range(6):
        session, belief = ambiguous(seed)
        one = session.suggest(1)[0]
        if len(one.reports) < 2:
            continue
        for report in one.reports:
            if report.touches:
                felt = Contacts(
                    report.point_world[None],
                    report.normal_world[None],
                    position_error=REACH,
                    normal_error=CONE,
                )
                after = session.recognizer.update(belief, felt)
                left = {hypothesis.object_name for hypothesis in after.hypotheses}
                assert report.rivals[0].object_name in left
                told_apart += len(left) < len({h.object_name for h in belief.hypotheses})
    assert told_apart > 0


@pytest.mark.parametrize("seed", range(3))
def test_a_touch_starts_where_no_rival_is_in_the_way(seed):
    session, _, _ = begun(seed, 6)
    belief = session.belief
    assert belief is not None
    middle = belief.hypotheses[0].pose.apply(LIBRARY[0].centroid)
    for region in (None, Region(middle - 3.0, middle + [3.0, 3.0, 0.0])):
        named = session.suggest(5, region=region)
        assert named
        for one in named:
            assert one.direction_world[2] <= 1e-9
            for hypothesis in belief.hypotheses:
                solid = next(part for part in LIBRARY if part.name == hypothesis.object_name)
                behind, _ = met(solid, hypothesis.pose, one.start_world, -one.direction_world)
                assert behind == np.inf


def test_suggested_touches_keep_the_truth_and_leave_fewer_rivals_than_random_ones():
    left: dict[str, list[float]] = {"suggested": [], "random": []}
    for seed in range(10):
        for kind, rivals in left.items():
            session, pose, faces = begun(seed, 3)
            rng = np.random.default_rng(100 + seed)
            for _ in range(2):
                named = session.suggest(1) if kind == "suggested" else at_random(session, pose, rng)
                contacts, ways, more = touch_as_suggested(named[0], pose, rng)
                session.add(contacts, free_space=ways)
                faces = faces + more
                assert holds(session.belief, faces)
            assert session.belief is not None
            rivals.append(np.log(len(session.belief.hypotheses)))
    assert np.mean(left["suggested"]) < np.mean(left["random"]) - 0.1


def at_random(session: Session, pose: RigidTransform, rng: np.random.Generator):
    """A touch along an axis that goes through the box around the part, anywhere in it."""
    corners = pose.apply(LIBRARY[0].vertices)
    place = rng.uniform(corners.min(axis=0), corners.max(axis=0))
    region = Region(corners.min(axis=0) - 1.0, corners.max(axis=0) + 1.0)
    reach = Reach.of(region, None, None, 0.0)
    touch = reach.through(place[None], rng.choice(reach.named, 1))
    return [
        Suggestion(
            touch.starts[0], touch.directions[0], float(touch.lengths[0]), Purpose.FIND, 0, 0, ()
        )
    ]


def test_once_it_is_unique_touches_refine_the_pose_and_do():
    session, pose, faces = begun(1, 14)
    belief = session.belief
    assert belief is not None
    assert belief.unique
    one, *_ = named = session.suggest(3)
    assert {each.purpose for each in named} == {Purpose.REFINE}
    assert [len(each.reports) for each in named] == [1, 1, 1]
    contacts, ways, more = touch_as_suggested(one, pose, np.random.default_rng(0))
    after = session.add(contacts, free_space=ways)
    assert holds(after, faces + more)
    assert after is not None
    before, now = (np.linalg.slogdet(b.hypotheses[0].covariance)[1] for b in (belief, after))
    assert now < before - 0.05


def test_touches_stay_in_the_region_and_along_the_directions():
    session, pose, _ = begun(3, 4)
    middle = pose.apply(LIBRARY[0].centroid)
    region = Region(middle - 1.0, middle + [0.5, 0.6, 0.7])
    named = session.suggest(8, region=region, directions=[AXES["-x"], (0.0, 0.0, -2.0)])
    assert len(named) > 3
    for one in named:
        assert one.direction_world.tolist() in ([-1.0, 0.0, 0.0], [0.0, 0.0, -1.0])
        for end in (one.start_world, one.end_world):
            assert (end >= region.low - 1e-9).all()
            assert (end <= region.high + 1e-9).all()
        edge = np.minimum(np.abs(one.start_world - region.high), np.abs(one.end_world - region.low))
        assert np.abs(edge[np.abs(one.direction_world) > 0.5]).max() < 1e-9


def test_above_a_plane_no_touch_comes_from_below_or_goes_through_it():
    normal = np.array([0.1, 0.2, 1.0]) / np.linalg.norm([0.1, 0.2, 1.0])
    plain, pose, _ = begun(3, 4)
    height = float((pose.apply(LIBRARY[0].vertices) @ normal).min())
    plane = SupportPlane(height=height, error=0.02, normal=(*normal.tolist(),))
    session, _, _ = begun(3, 4, support=plane)
    landing = 0
    for one in session.suggest(12):
        assert one.direction_world @ normal <= 1e-9
        heights = np.array([one.start_world, one.end_world]) @ normal - height
        assert heights.min() > -1e-9
        landing += heights[1] < 1e-9
    assert landing > 0
    assert any(one.end_world @ normal < height for one in plain.suggest(12))


def test_without_a_contact_touches_go_from_the_middle_to_where_nothing_was():
    session = Session(LIBRARY)
    region = Region([0.0, 0.0, 0.0], [10.0, 10.0, 4.0])
    first, second, *_ = session.suggest(3, region=region)
    assert first.start_world.tolist() == [5.0, 5.0, 4.0]
    assert first.direction_world.tolist() == [0.0, 0.0, -1.0]
    assert first.end_world.tolist() == [5.0, 5.0, 0.0]
    assert (first.purpose, first.reports) == (Purpose.FIND, ())
    miss = FreeSpace(first.start_world[None], first.end_world[None], error=REACH)
    assert session.add(free_space=miss) is None
    again = session.suggest(1, region=region)[0]
    assert again.start_world.tolist() == second.start_world.tolist()
    assert np.linalg.norm(again.start_world - first.start_world) > 4.0


def test_a_miss_before_the_first_contact_counts_once_there_is_one():
    _, pose, _ = begun(5, 4)
    contacts, faces = random_contacts(
        LIBRARY[0], pose, 4, np.random.default_rng(0), position_error=REACH, normal_error=CONE
    )
    through = pose.apply(LIBRARY[0].centroid) + [[0.0, 0.0, 5.0], [0.0, 0.0, -5.0]]
    miss = FreeSpace(through[:1], through[1:], error=REACH)
    before, after, without = (Session(LIBRARY) for _ in range(3))
    before.add(free_space=miss)
    for session in (before, after, without):
        session.add(contacts)
    after.add(free_space=miss)
    assert before.belief is not None
    assert after.belief is not None
    assert len(before.belief.free_space) == 1
    # The way goes through where the object is, which contacts alone can't know.
    assert holds(without.belief, faces.tolist())
    assert not holds(before.belief, faces.tolist())
    assert interpretations_of(before.belief) == interpretations_of(after.belief)


def test_touch_by_touch_it_believes_what_it_would_of_all_at_once():
    session, _, _ = begun(6, 5)
    whole = session.belief
    assert whole is not None
    parts = Session(LIBRARY)
    for row in range(5):
        parts.add(whole.contacts[np.array([row])])
    assert parts.belief is not None
    weights = [
        {(h.object_name, len(h.interpretations)) for h in b.hypotheses}
        for b in (whole, parts.belief)
    ]
    assert weights[0] == weights[1]


def test_a_policy_of_any_name_suggests_the_same_from_the_same_seed():
    session, _, _ = begun(4, 4)
    for policy in FORMULAS:
        once, again = (session.suggest(2, policy=policy, seed=5) for _ in range(2))
        assert len(once) == 2
        for one, other in zip(once, again, strict=True):
            assert one.start_world.tolist() == other.start_world.tolist()
            assert one.score == other.score
        assert once[0].rules_out > 0.1


def test_normals_that_are_not_felt_tell_nothing_apart():
    """Two poses are met at the same depth by faces that lean either way."""
    turns = Rotation.from_rotvec([[0.0, 0.5, 0.0], [0.0, -0.5, 0.0]])
    rows, spread = np.arange(2), np.zeros(2)
    samples = samples_of(
        LIBRARY[2:], 0 * rows, rows, np.zeros((2, 3)), turns.as_quat(), np.ones(2), spread, spread
    )
    normals = np.array([[0.5, 0.0, np.sqrt(0.75)], [-0.5, 0.0, np.sqrt(0.75)]])
    told = Predictions(
        np.full((2, 1, 1), MET_OBJECT, np.int8),
        np.ones((2, 1, 1)),
        normals[:, None, None],
        np.zeros((2, 1, 1)),
    )
    start, down = np.array([0.0, 0.0, 3.0]), np.array([0.0, 0.0, -1.0])
    for cone, reports, left in ((0.3, 2, 0.0), (np.pi, 1, 1.0)):
        found = reports_of(samples, told, start, down, position_error=REACH, normal_error=cone)
        assert len(found) == reports
        task = Task(
            library=tuple(LIBRARY[2:]),
            space=ProbeSpace(1.0, 1.0),
            position_error=REACH,
            normal_error=cone,
        )
        rays = TriadRays(start[None, None], down[None, None])
        outcomes = Outcomes.of_predictions(task, samples, start[None], rays, told)
        assert outcomes.left[0, 0, 1] == pytest.approx(left, abs=1e-4)


@pytest.mark.parametrize(("apart", "reports"), [(0.019, 1), (0.021, 2)])
def test_two_rivals_say_the_same_if_one_reading_within_the_bounds_may_be_of_either(apart, reports):
    """Across the face, which the touch comes to at 60 degrees, they are half as far apart."""
    rows, none = np.arange(2), np.zeros(2)
    samples = samples_of(
        LIBRARY[2:], 0 * rows, rows, np.zeros((2, 3)), np.eye(4)[[3, 3]], np.ones(2), none, none
    )
    leaning = np.array([np.sqrt(0.75), 0.0, 0.5])
    told = Predictions(
        np.full((2, 1, 1), MET_OBJECT, np.int8),
        np.array([1.0, 1.0 + 2.0 * apart]).reshape(2, 1, 1),
        np.tile(leaning, (2, 1, 1, 1)),
        np.zeros((2, 1, 1)),
    )
    start, down = np.array([0.0, 0.0, 3.0]), np.array([0.0, 0.0, -1.0])
    found = reports_of(samples, told, start, down, position_error=REACH, normal_error=CONE)
    assert len(found) == reports
    assert found[0].depths == pytest.approx((1.0, 1.0 + 2.0 * apart * (reports == 1)))


def test_where_nothing_fits_nothing_is_suggested():
    session, _, _ = begun(0, 6)
    session.add(Contacts([[50.0, 0.0, 0.0]], position_error=REACH))
    assert session.belief is not None
    assert session.belief.empty
    assert session.suggest() == ()


def test_what_cannot_be_is_refused():
    square = Polygon.from_corners([(0, 0), (1, 0), (1, 1), (0, 1)], name="square")
    with pytest.raises(ValueError, match="'square' is an outline"):
        Session([square])  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="outliers is -1"):
        Session(LIBRARY, outliers=-1)
    session = Session(LIBRARY)
    with pytest.raises(ValueError, match="give the region"):
        session.suggest()
    with pytest.raises(ValueError, match="policy is 'psychic'; it must be one of information"):
        session.suggest(policy="psychic")
    with pytest.raises(ValueError, match="count is 0"):
        session.suggest(0)
    with pytest.raises(ValueError, match="each number of low must be below"):
        Region([0, 0, 0], [1, 0, 1])
    with pytest.raises(ValueError, match=r"low is .* three numbers"):
        Region([0, 0], [1, 1, 1])
    region = Region([0, 0, 0], [1, 1, 1])
    for directions, words in (
        ([[0.0, 0.0, 0.0]], "row 0 is"),
        ([1.0, 0.0, 0.0], "shape"),
        (np.zeros((0, 3)), "at least 1"),
    ):
        with pytest.raises(ValueError, match=words):
            session.suggest(region=region, directions=directions)


def test_contacts_that_are_refused_leave_the_session_as_it_was():
    session, _, _ = begun(0, 4)
    before = session.belief
    with pytest.raises(ValueError, match="2 coordinates"):
        session.add(Contacts([[0.0, 0.0]], position_error=REACH))
    assert session.belief is before
