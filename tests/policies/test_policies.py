from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from oracles.geometry import triangle_distances
from oracles.solids import blocks
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.policies import GOALS, POLICY_NAMES, Rate, Task, make_policy
from palpate.policies.decision_region import edges_cut
from palpate.policies.grid import RAYS, SIDE
from palpate.policies.information import gain_of_answers, gain_of_hypotheses
from palpate.policies.lookahead import two_ahead
from palpate.policies.minimax import TIE, UNLIKELY, worst_case
from palpate.policies.outcomes.candidates import aimed_actions, spread_actions
from palpate.policies.outcomes.outcomes import Outcomes
from palpate.policies.outcomes.paths import agreement
from palpate.policies.outcomes.pose_information import (
    PlacedModel,
    gain,
    gain_to_tolerance,
    known,
    rows_of,
)
from palpate.policies.outcomes.rivals import (
    answers,
    leading_rows,
    same_answer,
    taken,
    thinned,
)
from palpate.policies.outcomes.weighing import Budget
from palpate.policies.pairs import pairs_told_apart
from palpate.policies.pruning import weight_removed
from palpate.policies.safe_region import safest_cell
from palpate.policies.separation import separation
from palpate.recognizer import Polyhedron, PoseTolerance, pose_difference
from palpate.recognizer.models.rays import cast_rays
from palpate.recognizer.predict.prediction import (
    MET_OBJECT,
    MET_PLANE,
    PoseSamples,
    Predictions,
    samples_of,
)
from palpate.recognizer.predict.probes import ProbeSpace

REACH, CONE = 1e-3, np.radians(20.0)
SPACE = ProbeSpace(half_width=0.03, reach=0.16)
MM = 1e-3
BLIND = ("random", "random-hit", "grid")
INFORMED = tuple(name for name in POLICY_NAMES if name not in BLIND)


def notched() -> Polyhedron:
    """A bar of 60 x 20 x 24 mm with the upper half of its last 15 mm cut away."""
    solid = np.ones((2, 1, 2), bool)
    solid[1, 0, 1] = False
    mesh = blocks(solid, [-30 * MM, 15 * MM, 30 * MM], [-10 * MM, 10 * MM], [-12 * MM, 0, 12 * MM])
    return Polyhedron.from_mesh(mesh, name="notched")


def cube() -> Polyhedron:
    return Polyhedron.from_mesh(trimesh.creation.box((30 * MM, 30 * MM, 30 * MM)), name="cube")


BAR, CUBE = notched(), cube()


def task_for(*models: Polyhedron, **settings) -> Task:
    return Task(
        library=models or (BAR,),
        space=SPACE,
        position_error=REACH,
        normal_error=CONE,
        **settings,
    )


def samples_at(
    models, poses, *, objects=None, hypotheses=None, weights=None, spread=0.0, turn=0.0
) -> PoseSamples:
    count = len(poses)
    return samples_of(
        models,
        np.zeros(count, int) if objects is None else np.asarray(objects),
        np.arange(count) if hypotheses is None else np.asarray(hypotheses),
        np.array([pose.translation for pose in poses]),
        np.array([pose.rotation.as_quat() for pose in poses]),
        np.ones(count) if weights is None else np.asarray(weights, float),
        np.full(count, spread),
        np.full(count, turn),
    )


def placed(turn_deg=0.0, x=0.0, y=0.0, z=0.0) -> RigidTransform:
    turn = Rotation.from_euler("z", turn_deg, degrees=True)
    return RigidTransform.from_components((x, y, z), turn)


def observation_of(samples: PoseSamples, contacts=None, sent=0):
    points, normals = contacts or (np.zeros((0, 3)), np.zeros((0, 3)))
    count = len(points)
    return {
        "sample_count": np.array([len(samples)]),
        "sample_objects": samples.objects,
        "sample_hypotheses": samples.hypotheses,
        "sample_positions": samples.positions,
        "sample_quaternions": samples.rotations,
        "sample_weights": samples.weights,
        "sample_position_spread": samples.position_spread,
        "sample_rotation_spread": samples.rotation_spread,
        "hypothesis_count": np.array([len(np.unique(samples.hypotheses))]),
        "contact_count": np.array([count]),
        "contact_positions": np.asarray(points),
        "contact_normals": np.asarray(normals),
        "contact_position_error": np.full(count, REACH),
        "contact_normal_error": np.full(count, CONE),
        "ray_count": np.array([sent]),
        "ray_starts": np.tile([0.0, 0.0, 0.2], (sent, 1)),
        "ray_ends": np.tile([0.0, 0.1, 0.0], (sent, 1)),
    }


def random_outcomes(rng, *, count=7, probes=5, free_space=False, spread=1.0) -> Outcomes:
    """Reports made up: near each other in places, touches and misses mixed."""
    task = task_for(free_space=free_space)
    poses = [placed(40.0 * k, 5e-3 * k) for k in range(count)]
    samples = samples_at((BAR,), poses, weights=rng.random(count), turn=0.02 * spread)
    normals = rng.normal([0.0, 0.0, 2.0], 0.5, (count, probes, 3, 3))
    told = Predictions(
        np.where(rng.random((count, probes, 3)) < 0.7, MET_OBJECT, MET_PLANE).astype(np.int8),
        0.1 + 1.5e-3 * rng.random((count, probes, 3)),
        normals / np.linalg.norm(normals, axis=-1, keepdims=True),
        spread * 5e-4 * rng.random((count, probes, 3)),
    )
    actions = rng.uniform(-1.0, 1.0, (probes, 3))
    chances = rng.random(count)
    return Outcomes(
        task,
        samples,
        actions,
        task.space.rays(actions),
        told,
        same_answer(task, samples),
        chances / chances.sum(),
    )


def slow_pair(outcomes: Outcomes, a: int, i: int, j: int) -> tuple[float, float]:
    """How likely pose j is left by probe a if i is true, and how far apart their reports are."""
    told, task = outcomes.predictions, outcomes.task
    left, apart = 1.0, 0.0
    for k in range(3):
        mine = told.outcomes[i, a, k] == MET_OBJECT
        other = told.outcomes[j, a, k] == MET_OBJECT
        if mine != other and (mine or task.free_space):
            return 0.0, np.inf
    for k in range(3):
        if told.outcomes[i, a, k] != MET_OBJECT or told.outcomes[j, a, k] != MET_OBJECT:
            continue
        slope = abs(told.normals_world[j, a, k] @ outcomes.rays.directions_world[a, k])
        spread = np.hypot(told.depth_spread[i, a, k], told.depth_spread[j, a, k])
        x = abs(told.depths[i, a, k] - told.depths[j, a, k]) * slope
        x /= task.position_error + slope * spread
        cone = task.normal_error + np.hypot(*outcomes.samples.rotation_spread[[i, j]])
        chord = np.linalg.norm(told.normals_world[i, a, k] - told.normals_world[j, a, k])
        y = chord / (2.0 * np.sin(cone))
        apart = max(apart, x / 2.0, y)
        if x >= 2.0 or y >= 1.0:
            left = 0.0
            continue
        # The share of a ball's slices, of area 1 - t^2, beyond a plane x - 1 from its middle ...
        slices = np.linspace(x - 1.0, 1.0, 4001)
        left *= np.trapezoid(1.0 - slices**2, slices) * 0.75
        # ... and of a disc of radius 1 that another one, 2 y away, covers.
        across = np.linspace(y, 1.0, 4001)
        left *= 4.0 * np.trapezoid(np.sqrt(1.0 - across**2), across) / np.pi
    return left, apart


@pytest.mark.parametrize("free_space", [False, True])
def test_what_is_left_is_what_a_slow_reckoning_says(free_space):
    rng = np.random.default_rng(3)
    outcomes = random_outcomes(rng, count=9, probes=12, free_space=free_space)
    count, probes = len(outcomes.samples), len(outcomes.actions)
    slow = np.array(
        [
            [[slow_pair(outcomes, a, i, j) for j in range(count)] for i in range(count)]
            for a in range(probes)
        ]
    )
    different = ~np.broadcast_to(outcomes.same, slow.shape[:3])
    np.testing.assert_allclose(outcomes.left[different], slow[..., 0][different], atol=3e-3)
    np.testing.assert_allclose(outcomes.distances[different], slow[..., 1][different], rtol=1e-4)
    assert (outcomes.left[~different] == 1.0).all()
    assert (outcomes.distances[~different] == 0.0).all()
    soft = (slow[..., 0] > 0.05) & (slow[..., 0] < 0.95) & different
    assert soft.sum() > 20  # the sample has something to compare
    # Told apart for certain is the same for both measures.
    np.testing.assert_array_equal(outcomes.distances >= 1.0, outcomes.left == 0.0)


def test_formulas_are_what_they_say():
    rng = np.random.default_rng(4)
    outcomes = random_outcomes(rng, count=6, probes=4)
    w, left, apart = outcomes.weights, outcomes.left.astype(float), outcomes.distances
    p = outcomes.chances
    likely = np.flatnonzero(p >= UNLIKELY * p.max())
    n = range(len(w))
    for a in range(len(outcomes.actions)):
        removed = sum(p[i] * w[j] * (1.0 - left[a, i, j]) for i in n for j in n)
        assert weight_removed(outcomes)[a] == pytest.approx(removed, abs=1e-5)
        pairs = sum(p[i] * w[j] for i in n for j in n if apart[a, i, j] > 1.0)
        assert pairs_told_apart(outcomes)[a] == pytest.approx(pairs, abs=1e-5)
        bins = [sum(w[j] * left[a, i, j] for j in n) for i in n]
        told = -sum(p[i] * np.log(bins[i]) for i in n)
        assert gain_of_answers(outcomes.left, w, p)[a] == pytest.approx(told, abs=1e-5)
        worst = 1.0 - max(bins[i] for i in likely) + TIE * removed
        assert worst_case(outcomes)[a] == pytest.approx(worst, abs=1e-5)
        capped = np.minimum(apart[a], 1.0)
        rivals = [(i, j) for i in n for j in n if not outcomes.same[i, j]]
        least = min(max(capped[i, j], capped[j, i]) for i, j in rivals)
        mean = sum(p[i] * w[j] * capped[i, j] for i, j in rivals)
        assert separation(outcomes)[a] == pytest.approx(least + mean, abs=1e-5)


def test_edges_are_cut_between_decisions_alone():
    outcomes = random_outcomes(np.random.default_rng(5), count=6, probes=4)
    alike = np.eye(6, dtype=bool)
    alike[0, 1] = alike[1, 0] = True
    outcomes = Outcomes(
        outcomes.task,
        outcomes.samples,
        outcomes.actions,
        outcomes.rays,
        outcomes.predictions,
        alike,
        outcomes.chances,
    )
    w, p, left = outcomes.weights, outcomes.chances, outcomes.left.astype(float)
    edges = [(j, k) for j in range(6) for k in range(j) if not alike[j, k]]
    total = sum(w[j] * w[k] for j, k in edges)
    for a, cut in enumerate(edges_cut(outcomes)):
        kept = sum(
            p[i] * w[j] * w[k] * left[a, i, j] * left[a, i, k] for i in range(6) for j, k in edges
        )
        assert cut == pytest.approx(1.0 - kept / total, abs=1e-5)


def test_two_probes_ahead_see_what_neither_does_alone():
    # Probe 0 tells half of four rivals from the other half, probe 1 the halves of both;
    # probe 2 tells one rival alone, and nothing that goes with it tells the rest.
    bits = np.array([[0, 0, 1, 1], [0, 1, 0, 1], [0, 0, 0, 1]])
    left = (bits[:, :, None] == bits[:, None, :]).astype(np.float32)
    weights = np.full(4, 0.25)
    alone = gain_of_answers(left, weights, weights)
    worth = two_ahead(left, weights, weights, alone)
    np.testing.assert_allclose(alone[:2], np.log(2.0), rtol=1e-6)
    np.testing.assert_allclose(worth[:2] - 0.1 * alone[:2], np.log(4.0), rtol=1e-6)
    assert worth[2] < worth[0]


def test_the_middle_of_the_largest_safe_region_is_probed():
    told = np.zeros((2, 7, 7))
    told[0, 1:6, 1:6] = 0.92
    told[1, 0:2, 0:2] = 1.0
    assert safest_cell(told) == (0, 3, 3)
    told[0, 3, 3] = 0.5  # a hole: what is left of the large region is a ring, one or two cells wide
    assert safest_cell(told)[0] == 0


def test_a_touch_may_be_explained_by_any_face():
    """Against distances of points from triangles, one triangle and one face at a time."""
    rng = np.random.default_rng(8)
    task = task_for()
    poses = [placed(0.0), placed(180.0), placed(0.0, 0.8e-3), placed(90.0, 2e-3)]
    samples = samples_at((BAR,), poses)
    actions = aimed_actions(SPACE, samples, 40, rng)
    quick = Outcomes.of(task, samples, actions)
    thorough = quick.thoroughly(np.arange(len(actions)))
    told = quick.predictions
    slow = np.ones_like(thorough.left, float)
    for a, i, j in np.argwhere(~np.broadcast_to(quick.same, quick.left.shape)):
        for k in np.flatnonzero(told.outcomes[i, a] == MET_OBJECT):
            start, along = quick.rays.starts_world[a, k], quick.rays.directions_world[a, k]
            point = poses[j].inv().apply(start + told.depths[i, a, k] * along)
            normal = poses[j].rotation.inv().apply(told.normals_world[i, a, k])
            best = 0.0
            for face in range(BAR.face_count):
                triangles = BAR.vertices[BAR.triangles[BAR.triangle_faces == face]]
                x = triangle_distances(point[None], triangles).min() / REACH
                y = np.linalg.norm(BAR.normals[face] - normal) / (2.0 * np.sin(CONE))
                if x < 2.0 and y < 1.0:
                    t = 1.0 - x
                    overlap = 1.0 - 2.0 / np.pi * (np.arcsin(y) + y * np.sqrt(1.0 - y**2))
                    best = max(best, 0.25 * (2.0 + 3.0 * t - t**3) * overlap)
            slow[a, i, j] *= best
    differ = np.abs(thorough.left - slow)
    # Where one face explains a good share already, no other one is looked for.
    assert (thorough.left <= slow + 3e-3).all()
    assert differ[slow < 0.1].max() < 3e-3
    assert differ.max() < 0.35
    assert ((quick.left < 0.01) & (slow > 0.5)).any()  # hidden behind the notch's step, or beside


def test_poses_within_the_tolerance_are_one_answer():
    rng = np.random.default_rng(9)
    models = (BAR, CUBE)
    tolerance = PoseTolerance()
    task = task_for(*models, tolerance=tolerance)
    poses, objects = [], []
    for k in range(24):
        turn = Rotation.from_euler(
            "xyz", [90.0 * rng.integers(4), 0.0, 90.0 * rng.integers(4)], True
        )
        wobble = Rotation.from_rotvec(rng.normal(0.0, np.radians(1.0), 3))
        shift = rng.normal(0.0, 0.7e-3, 3)
        poses.append(RigidTransform.from_components(shift, wobble * turn))
        objects.append(k % 2)
    same = same_answer(task, samples_at(models, poses, objects=objects))
    for i in range(24):
        for j in range(24):
            expected = objects[i] == objects[j]
            if expected:
                model = models[objects[i]]
                gap = pose_difference(model, poses[i], poses[j])
                near = tolerance.distance(model.diameter, REACH)
                expected = gap.rotation <= tolerance.rotation and gap.translation <= near
            assert same[i, j] == expected
    assert 24 < same.sum() < 24 * 24 / 2
    by_name = same_answer(
        task_for(*models, goal="object"), samples_at(models, poses, objects=objects)
    )
    np.testing.assert_array_equal(by_name, np.equal.outer(objects, objects))


def test_answers_group_what_is_the_same_around_the_heaviest():
    same = np.array([[1, 1, 0, 0], [1, 1, 1, 0], [0, 1, 1, 0], [0, 0, 0, 1]], bool)
    np.testing.assert_array_equal(answers(same, np.array([0.1, 0.5, 0.2, 0.2])), [0, 0, 0, 1])
    found = answers(same, np.array([0.5, 0.1, 0.2, 0.2]))
    assert found[0] == found[1] != found[2] != found[3]


def test_thinned_samples_keep_every_hypothesis_and_its_share():
    rng = np.random.default_rng(2)
    hypotheses = np.sort(rng.integers(10, size=90))
    samples = samples_at((BAR,), [placed()] * 90, hypotheses=hypotheses, weights=rng.random(90))
    thin = thinned(samples, 30)
    assert len(thin) == 30
    for number in range(10):
        before = samples.weights[samples.hypotheses == number].sum()
        assert thin.weights[thin.hypotheses == number].sum() == pytest.approx(before)
    lead = taken(samples, leading_rows(samples, 3))
    shares = np.bincount(hypotheses, samples.weights)
    np.testing.assert_array_equal(lead.hypotheses, np.argsort(-shares)[:3])


def test_an_unknown_name_is_told_which_there_are():
    with pytest.raises(
        ValueError, match=r"no policy is called 'best'; there are: random, .*refine"
    ):
        make_policy("best", task_for())


@pytest.mark.parametrize("name", [name for name in POLICY_NAMES if name != "grid"])
def test_before_the_first_contact_the_probe_is_the_random_one(name):
    nothing = observation_of(PoseSamples.none((BAR,)))
    action = make_policy(name, task_for()).act(nothing, np.random.default_rng(1))
    expected = make_policy("random", task_for()).act(nothing, np.random.default_rng(1))
    np.testing.assert_array_equal(action, expected)


def rivals_at_both_ends() -> PoseSamples:
    """Two hypotheses that differ in which end of the bar is notched, with poses nearly fixed."""
    return samples_at((BAR,), [placed(10.0), placed(190.0)], spread=2e-4, turn=5e-3)


def contacts_on_the_bar(rng, count: int):
    """Points on the sides of the bar as both rivals have it, away from the notch."""
    points = np.column_stack(
        [rng.uniform(-0.012, 0.012, count), np.full(count, 0.01), rng.uniform(0, 0.01, count)]
    )
    normals = np.tile([0.0, 1.0, 0.0], (count, 1))
    return placed(10.0).apply(points), placed(10.0).rotation.apply(normals)


@pytest.mark.parametrize("name", POLICY_NAMES)
def test_the_same_stream_gives_the_same_probe_to_the_bit(name):
    observation = observation_of(
        rivals_at_both_ends(), contacts_on_the_bar(np.random.default_rng(0), 4), sent=6
    )
    before = {key: value.copy() for key, value in observation.items()}
    policy = make_policy(name, task_for())
    actions = [policy.act(observation, np.random.default_rng(7)) for _ in range(2)]
    actions.append(make_policy(name, task_for()).act(observation, np.random.default_rng(7)))
    for action in actions:
        assert action.dtype == np.float32
        assert action.shape == (3,)
        assert (np.abs(action) <= 1.0).all()
        np.testing.assert_array_equal(action, actions[0])
    for key, value in observation.items():
        np.testing.assert_array_equal(value, before[key])


@pytest.mark.parametrize("free_space", [False, True])
@pytest.mark.parametrize("name", INFORMED)
def test_the_probe_goes_to_the_end_where_two_rivals_differ(name, free_space):
    samples = rivals_at_both_ends()
    task = task_for(free_space=free_space)
    observation = observation_of(samples, contacts_on_the_bar(np.random.default_rng(0), 6), sent=6)
    for seed in range(3):
        action = make_policy(name, task).act(observation, np.random.default_rng(seed))
        rays = task.space.rays(action[None].astype(float))
        told_apart = [
            _certainly_told(rays.starts_world[0], rays.directions_world[0], *pair)
            for pair in ((placed(10.0), placed(190.0)), (placed(190.0), placed(10.0)))
        ]
        assert any(told_apart)


def _certainly_told(starts, directions, true: RigidTransform, rival: RigidTransform) -> bool:
    """Whether what is felt at one pose lies clearly off the surface of the other."""
    hits = cast_rays(BAR, true, starts, directions)
    above = hits.hit & (hits.points_world[:, 2] > 0.0)
    triangles = BAR.vertices[BAR.triangles]
    for point, normal in zip(hits.points_world[above], hits.normals_world[above], strict=True):
        inside = rival.inv().apply(point)
        turned = rival.rotation.inv().apply(normal)
        allowed = BAR.normals[BAR.triangle_faces] @ turned > np.cos(2.0 * CONE)
        if triangle_distances(inside[None], triangles[allowed]).min() > 2.0 * REACH:
            return True
    return False


@pytest.mark.parametrize("name", INFORMED)
def test_one_hypothesis_with_an_open_freedom_is_probed_where_that_is_fixed(name):
    """A family along the bar, felt on its sides and top alone: an end face has to be touched."""
    along = np.linspace(-4e-3, 4e-3, 9)
    samples = samples_at((BAR,), [placed(x=x) for x in along], hypotheses=np.zeros(9, int))
    rng = np.random.default_rng(1)
    points = np.array([[-10, 10, 4], [10, 10, 8], [0, -10, 5], [-20, 0, 12], [5, 3, 12]]) * MM
    normals = np.array([[0, 1, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, 1]], float)
    action = make_policy(name, task_for()).act(observation_of(samples, (points, normals)), rng)
    rays = SPACE.rays(action[None].astype(float))
    fixed = 0.0
    for pose in (placed(x=x) for x in along):
        hits = cast_rays(BAR, pose, rays.starts_world[0], rays.directions_world[0])
        above = hits.hit & (hits.points_world[:, 2] > 0.0)
        fixed = max(fixed, np.abs(hits.normals_world[above, 0]).max(initial=0.0))
    assert fixed > 0.9


def test_the_name_alone_needs_no_pose():
    """A cube and a bar, each at two poses: only what tells the objects apart counts."""
    models = (BAR, CUBE)
    poses = [placed(0.0), placed(180.0), placed(0.0), placed(20.0)]
    samples = samples_at(models, poses, objects=[0, 0, 1, 1])
    actions = spread_actions(40, np.random.default_rng(0))
    both, name = (
        weight_removed(Outcomes.of(task_for(*models, goal=goal), samples, actions))
        for goal in ("both", "object")
    )
    assert (name <= both + 1e-6).all()
    assert (name < both - 0.05).any()
    assert set(GOALS) == {"object", "pose", "both"}


def test_random_hit_touches_something_that_may_be_there():
    samples = samples_at((CUBE,), [placed(x=20 * MM, y=-15 * MM)])
    policy = make_policy("random-hit", task_for(CUBE))
    for seed in range(20):
        action = policy.act(observation_of(samples), np.random.default_rng(seed))
        rays = SPACE.rays(action[None].astype(float))
        hits = cast_rays(
            CUBE, placed(x=20 * MM, y=-15 * MM), rays.starts_world[0], rays.directions_world[0]
        )
        assert (hits.points_world[hits.hit, 2] > 0.0).any()


def test_the_grid_goes_through_all_its_points_and_then_turns():
    policy = make_policy("grid", task_for())
    seen = np.array(
        [
            policy.act({"ray_count": np.array([RAYS * k])}, np.random.default_rng(0))
            for k in range(2 * SIDE**2)
        ]
    )
    assert len(np.unique(seen, axis=0)) == 2 * SIDE**2
    assert len(np.unique(seen[: SIDE**2, 2])) == 1
    np.testing.assert_allclose(np.unique(seen[:, 0]), [-0.8, -0.4, 0.0, 0.4, 0.8], atol=1e-7)
    # Far apart first: the first five points are the middle and the corners.
    assert np.abs(seen[1:5, :2]).min() == pytest.approx(0.8)


def test_aimed_probes_reach_the_point_they_are_aimed_at():
    samples = samples_at((BAR,), [placed(30.0, 5e-3), placed(120.0)])
    actions = aimed_actions(SPACE, samples, 50, np.random.default_rng(0))
    assert 30 < len(actions) <= 50
    assert (np.abs(actions) <= 1.0).all()
    touching = np.maximum(
        *(
            Outcomes.of(task_for(), taken(samples, np.array([row])), actions).predictions.outcomes[
                0
            ]
            == MET_OBJECT
            for row in (0, 1)
        )
    )
    assert touching.any(axis=1).all()
    anywhere = Outcomes.of(task_for(), samples, spread_actions(200, np.random.default_rng(1)))
    assert (anywhere.predictions.outcomes == MET_OBJECT).any(axis=(0, 2)).mean() < 0.98


def test_rows_of_the_jacobian_are_slopes_of_heights():
    """The height of a world point over a face that moves with the object, by differences."""
    rng = np.random.default_rng(6)
    pose = placed(25.0, 4e-3, -2e-3, 1e-3)
    model = PlacedModel.of(samples_at((BAR,), [pose]), 0)
    point, normal, step = rng.normal(0.0, 0.02, 3), np.array([0.6, 0.0, 0.8]), 1e-5
    row = rows_of(model, point, normal)
    slopes = []
    for motion in np.eye(6):
        ends = []
        for sign in (1.0, -1.0):
            turn = Rotation.from_rotvec(sign * step * motion[:3] / model.radius)
            moved = turn.apply(point - model.centre) + model.centre + sign * step * motion[3:]
            ends.append(moved @ normal)
        slopes.append((ends[0] - ends[1]) / (2.0 * step))
    np.testing.assert_allclose(row, slopes, atol=1e-6)


def test_what_is_known_already_is_worth_nothing_down_to_the_tolerance():
    before = np.diag([1e4, 1e4, 1e4, 1e8, 1e8, 1e8])
    rough, fine = np.zeros((6, 6)), np.zeros((6, 6))
    rough[0, 0], fine[5, 5] = 1e4, 1e8
    added = np.stack([rough, fine])
    np.testing.assert_allclose(gain(before, added), np.log(2.0), rtol=1e-9)
    told = gain_to_tolerance(before, added, 1e-3)
    # By hand: variances 1e-4 to 5e-5, and 1e-8 to 5e-9, each with 1e-6 beside it.
    expected = 0.5 * np.log([1.01e-4 / 5.1e-5, 1.01e-6 / 1.005e-6])
    np.testing.assert_allclose(told, expected, rtol=1e-6)


def test_contacts_are_counted_on_the_faces_they_were_felt_on():
    """Three contacts on each side of the bar: all is known but the shift along it."""
    pose = placed(0.0)
    model = PlacedModel.of(samples_at((BAR,), [pose]), 0)
    rng = np.random.default_rng(3)
    points, normals = [], []
    for axis, height in ((1, 10 * MM), (1, -10 * MM), (2, 12 * MM)):
        for _ in range(3):
            point = rng.uniform(-9 * MM, 9 * MM, 3)
            point[axis] = height
            normal = np.sign(height) * np.eye(3)[axis]
            points.append(point + rng.uniform(-0.3, 0.3, 3) * REACH)
            normals.append(Rotation.from_rotvec(rng.normal(0.0, 0.1, 3)).apply(normal))
    observation = observation_of(samples_at((BAR,), [pose]), (np.array(points), np.array(normals)))
    deviations = np.sqrt(np.diag(np.linalg.inv(known(observation, model))))
    assert deviations[3] > 0.3 * model.radius
    assert (deviations[4:] < REACH).all()


def test_refine_sends_the_candidate_with_the_largest_determinant():
    """No other probe of a thousand is better by more than a little."""
    pose = placed(15.0, 2e-3)
    samples = samples_at((BAR,), [pose])
    contacts = contacts_on_the_bar(np.random.default_rng(2), 5)
    observation = observation_of(samples, contacts)
    action = make_policy("refine", task_for()).act(observation, np.random.default_rng(0))
    model = PlacedModel.of(samples, 0)
    before = known(observation, model)

    def worth(probe) -> float:
        rays = SPACE.rays(np.asarray(probe, float)[None])
        hits = cast_rays(BAR, pose, rays.starts_world[0], rays.directions_world[0])
        total = before.copy()
        for point, normal in zip(hits.points_world, hits.normals_world, strict=True):
            if not point[2] > 0.0:
                continue
            row = np.append(np.cross(point - model.centre, normal) / model.radius, normal)
            total += 5.0 / REACH**2 * np.outer(row, row)
            tilt = (2.0 * np.sin(0.5 * CONE) * model.radius) ** 2
            total[:3, :3] += 4.0 / tilt * (np.eye(3) - np.outer(normal, normal))
        return float(np.linalg.slogdet(total)[1])

    others = [worth(probe) for probe in np.random.default_rng(5).uniform(-1, 1, (1000, 3))]
    assert worth(action) > max(others) - 0.6
    assert worth(action) > np.median(others) + 1.0


def test_a_pose_that_rays_went_through_is_hardly_the_true_one():
    samples = samples_at((BAR,), [placed(10.0), placed(190.0)], spread=2e-4, turn=1e-3)
    observation = observation_of(samples, sent=4)
    # Down through the end that only the second has whole, and beside both, and onto both.
    for row, (x, end) in enumerate([(25 * MM, 2 * MM), (-50 * MM, 0.0), (0.0, 12 * MM)]):
        foot = placed(10.0).apply(np.array([x, 0.0, 0.0]))
        observation["ray_starts"][row] = foot + (0.0, 0.0, 0.1)
        observation["ray_ends"][row] = foot + (0.0, 0.0, end)
    observation["ray_starts"][3] = observation["ray_starts"][2]
    observation["ray_ends"][3] = observation["ray_ends"][2]
    np.testing.assert_allclose(agreement(task_for(), observation, samples), [1.0, 0.1])
    observation["ray_ends"][:] = observation["ray_starts"] + (0.1, 0.0, 0.0)
    # A ray that doesn't go down to the plane is none of the predictor's: it tells nothing here.
    np.testing.assert_allclose(agreement(task_for(), observation, samples), [1.0, 1.0])


def test_the_rate_is_information_over_a_hand_made_time():
    samples = rivals_at_both_ends()
    task = task_for()
    policy = Rate(task, travel_speed=0.5, probe_speed=0.01, probe_length=0.02, thinking=0.3)
    outcomes = Outcomes.of(task, samples, np.array([[0.1, -0.2, 0.3]]))
    observation = observation_of(samples, sent=3)
    observation["ray_starts"][2] = (0.1, 0.0, 0.2)
    starts = outcomes.rays.starts_world[0]
    depths = outcomes.predictions.depths[:, 0].mean(axis=0)
    way = np.linalg.norm(starts[0] - (0.1, 0.0, 0.2))
    way += np.linalg.norm(starts[1] - starts[0]) + np.linalg.norm(starts[2] - starts[1])
    way += sum(2.0 * depth - 0.02 for depth in depths)
    expected = way / 0.5 + 3 * 0.02 / 0.01 + 0.3
    assert policy.seconds(observation, outcomes)[0] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("name", "value"), [("travel_speed", 0.0), ("probe_speed", -1.0), ("probe_length", -0.1)]
)
def test_a_speed_that_is_none_is_refused(name, value):
    with pytest.raises(ValueError, match=name):
        Rate(task_for(), **{name: value})


def test_a_budget_weighs_fewer_probes_against_more_poses():
    budget = Budget()
    counts = [budget.probes(samples) for samples in (1, 10, 30, 64)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] == budget.most
    assert counts[-1] >= budget.fewest
    assert budget.shortlist(64) >= budget.fewest_thorough


def test_the_chain_rule_takes_the_family_out_of_what_is_told():
    """Three poses of one hypothesis and two of another: by hand, bin by bin."""
    outcomes = random_outcomes(np.random.default_rng(12), count=5, probes=6)
    families = np.array([0, 0, 0, 1, 1])
    samples = replace(outcomes.samples, hypotheses=families)
    outcomes = replace(outcomes, samples=samples)
    w, p, left = outcomes.weights, outcomes.chances, outcomes.left.astype(float)
    for a, told in enumerate(gain_of_hypotheses(outcomes)):
        by_hand = 0.0
        for i in range(5):
            own = np.flatnonzero(families == families[i])
            within = sum(w[j] * left[a, i, j] for j in own) / w[own].sum()
            by_hand -= p[i] * np.log(sum(w[j] * left[a, i, j] for j in range(5)) / within)
        assert told == pytest.approx(by_hand, abs=1e-5)
