"""The measurement of touch: its oracle against distances alone, its approaches, what it prints."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.processes import HEAVY, loaded_by
from oracles.geometry import signed_distances
from oracles.solids import box, model, random_pose
from scipy.spatial.transform import RigidTransform

from palpate.recognizer import Polyhedron, Recognizer
from palpate.scripts.lab.bench import placement as bench_placement
from palpate.scripts.lab.bench import touch as bench_touch
from palpate.scripts.lab.bench import touch_speed as bench_touch_speed
from palpate.scripts.lab.bench.touch_cases import KINDS, ApproachSampler, depth_in_hull
from palpate.scripts.lab.sweep_oracle import EDGE, FACE, VERTEX, SweepOracle


def test_the_commands_help_loads_nothing_heavy():
    assert not HEAVY & loaded_by("import palpate.scripts.lab.bench.touch")


@pytest.mark.parametrize("name", ["housing", "pocketed", "hull-20"])
@pytest.mark.parametrize("share", [0.01, 0.08])
def test_the_oracle_stops_a_ball_where_its_centre_is_as_near_as_its_radius(name, share):
    """Neither planes nor cylinders here: the distance along the way says it all."""
    solid, rng = model(name), np.random.default_rng(0)
    oracle, radius = SweepOracle(solid), share * solid.diameter
    kinds = []
    for _ in range(25):
        pose = random_pose(rng, solid.diameter)
        middle = pose.apply(solid.centroid)
        start = rng.normal(size=3)
        start = middle + 1.5 * solid.diameter * start / np.linalg.norm(start)
        towards = middle + 0.25 * solid.diameter * rng.normal(size=3) - start
        towards /= np.linalg.norm(towards)
        swept = oracle.sweep(pose, start, towards, radius)
        stop = min(swept.depth, 3.0 * solid.diameter)
        way = start + np.linspace(0.0, stop, 400)[:, None] * towards
        distances = signed_distances(solid, pose.inv().apply(way))
        assert distances.min() > radius * (1.0 - 1e-9)
        if np.isfinite(swept.depth):
            assert distances[-1] == pytest.approx(radius, rel=1e-9)
            contact = swept.position_world + radius * swept.normal_world
            assert np.allclose(contact, way[-1], atol=1e-9 * solid.diameter)
            at = pose.inv().apply(swept.position_world[None])
            assert abs(signed_distances(solid, at)[0]) < 1e-9 * solid.diameter
            kinds.append(swept.kind)
    assert {FACE, EDGE} <= set(kinds)


def test_the_oracle_tells_a_cubes_face_edge_and_vertex():
    cube = Polyhedron.from_mesh(box(2.0, 2.0, 2.0), name="cube")
    oracle, down = SweepOracle(cube), np.array([0.0, 0.0, -1.0])
    for place, kind, depth in (
        ([0.7, 0.7, 5.0], FACE, 2.5),  # beside the diagonal that halves the face
        ([1.0, 1.0, 5.0], FACE, 2.5),  # on it
        ([-0.3, 1.0, 5.0], EDGE, 2.6),
        ([-0.3, -0.3, 5.0], VERTEX, 3.0 - np.sqrt(0.07)),
        ([-0.6, 1.0, 5.0], -1, np.inf),
    ):
        swept = oracle.sweep(RigidTransform.identity(), np.array(place), down, 0.5)
        assert swept.depth == pytest.approx(depth)
        assert swept.kind == kind


def test_approaches_meet_what_they_aim_at_and_are_the_same_for_a_seed():
    solid = model("simple-hand")
    sampler = ApproachSampler(solid, 0.002, 0.4)
    for kind in KINDS:
        for feature in (0, sampler.count(kind) - 1):
            one, again = (sampler.draw(kind, feature, np.random.default_rng(3)) for _ in range(2))
            assert one is not None
            assert again is not None
            assert one.swept.kind == kind
            assert one.feature == feature
            assert np.array_equal(one.swept.position_world, again.swept.position_world)
            assert one.swept.normal_world @ one.direction_world < 0.0


def test_depth_in_the_hull_is_measured_from_its_faces():
    cube = Polyhedron.from_mesh(box(2.0, 2.0, 2.0), name="cube")
    assert depth_in_hull(cube, np.array([1.0, 1.0, 0.25])) == pytest.approx(0.25)
    assert depth_in_hull(cube, np.array([1.0, 1.0, 2.5])) == pytest.approx(-0.5)


@pytest.mark.parametrize("name", ["ball", "finger"])
def test_a_row_is_met_or_missed_by_its_largest_error(name, monkeypatch):
    solid = model("simple-hand")
    row = bench_touch._touch_row(name, solid, EDGE, 5, 0)
    assert row.met
    assert "100.00% of 5; 5 of 50 reached" in row.details[0]
    monkeypatch.setitem(bench_touch.POSITION_GOAL, name, 1e-12)
    assert bench_touch._touch_row(name, solid, EDGE, 5, 0).met is False


def test_the_speed_of_triads_has_a_row_an_object(monkeypatch):
    monkeypatch.setattr(bench_touch_speed, "TRIADS", 20)
    row = bench_touch_speed._triad_row("ball", model("housing"), 0)
    assert row.what == "ball, housing"
    assert row.goal == "1 ms"
    assert row.met is not None


def test_steps_are_timed_with_the_recogniser_and_triads_without():
    row = bench_touch_speed._step_row(12, 2)
    assert row.here.endswith("steps/s")
    assert "12 steps" in row.details[1]
    rate = bench_touch_speed._rate_row(300, 0)
    # Even a triad a millisecond would be a fiftieth of what it is.
    assert float(rate.here.replace(",", "").removesuffix(" /s")) > 1000.0


@pytest.mark.parametrize(
    ("script", "shown"),
    [
        ("import no_such_module", "not installed"),
        ("raise RuntimeError('no hand')", "does not run"),
        ("import sys; print([[0.001] * int(sys.argv[1]), []])", "1,000 steps/s"),
    ],
)
def test_another_environment_is_measured_where_it_is_installed(script, shown, monkeypatch):
    monkeypatch.setattr(bench_touch_speed, "ROBOTICS_STEPS", script)
    assert bench_touch_speed._robotics_row(3, None).here == shown


def test_a_python_that_is_not_there_is_said(tmp_path):
    row = bench_touch_speed._robotics_row(3, tmp_path / "python")
    assert row.here == "not measured"
    assert "No such file" in row.details[0]


def test_resting_and_lying_across_are_compared_probe_for_probe(monkeypatch):
    solid = model("simple-hand")
    monkeypatch.setattr(bench_placement, "load_library", lambda: (solid,))
    monkeypatch.setattr(bench_placement, "MOST_PROBES", 8)
    across, untold = bench_placement.measure_placement(4, 0)
    assert [row.what for row in across.rows] == ["simple-hand", "all"]
    assert across.rows[0].here == across.rows[1].here
    assert (across.rows[0].goal, untold.rows[0].met) == ("fewer", None)
    assert untold.rows[0].details[0].startswith(bench_placement.TOLD)
    assert bench_placement.measure_placement(4, 0)[1].rows == untold.rows


def test_knowing_the_plane_never_needs_more_probes_on_the_same_touches(monkeypatch):
    monkeypatch.setattr(bench_placement, "MOST_PROBES", 8)
    recognizer, solid = Recognizer([model("simple-hand")]), model("simple-hand")
    for index in range(6):
        told, untold = (
            bench_placement._play(recognizer, solid, way, np.random.SeedSequence(index))
            for way in (bench_placement.TOLD, bench_placement.UNTOLD)
        )
        assert told.probes <= untold.probes
        assert told.unique >= untold.unique


def test_the_interval_of_a_mean_is_around_it_and_narrows():
    rng = np.random.default_rng(0)
    few, many = rng.normal(-2.0, 1.0, 20), rng.normal(-2.0, 1.0, 2000)
    wide, narrow = (bench_placement.interval(x, np.random.default_rng(1)) for x in (few, many))
    assert wide[0] < few.mean() < wide[1]
    assert narrow[1] - narrow[0] < 0.3 * (wide[1] - wide[0])
    assert bench_placement.interval(np.full(5, -3.0), rng) == (-3.0, -3.0)
