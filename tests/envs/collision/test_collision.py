"""Collision parts: their union is the solid, whatever solid it is."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh
from oracles import solids as oracles
from oracles.convex_parts import (
    CSG_SEEDS,
    ROTATION,
    assert_union_is_the_solid,
    convex_solids,
    hollow_block,
    in_parts,
    part_volumes,
    random_csg,
    remade,
    together,
    user_mesh,
)
from scipy.spatial.transform import RigidTransform

from palpate.assets import STAND_IN_NAMES, load_parts
from palpate.envs.collision import convex_cuts
from palpate.envs.collision.collision import worked_out_parts
from palpate.recognizer.models.rays import cast_rays


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_a_stand_in_has_the_parts_it_was_built_from(name):
    model = oracles.model(name)
    found = worked_out_parts(model)
    own = load_parts(name)
    assert len(found.parts) == len(own)
    for part, other in zip(found.parts, own, strict=True):
        assert np.array_equal(part.vertices, other.vertices)
        assert np.array_equal(part.triangles, other.triangles)
    assert found.stray <= 1e-9 * model.diameter
    assert_union_is_the_solid(model, found)


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_a_stand_in_cut_as_any_mesh_gives_hardly_more_parts_than_it_was_built_from(name):
    model = user_mesh(name)
    found = worked_out_parts(model)
    assert len(found.parts) <= len(load_parts(name)) + 1
    assert found.stray <= 1e-9 * model.diameter
    assert part_volumes(found.parts) == pytest.approx(
        float(oracles.mesh_of(model).volume), rel=1e-9
    )
    assert_union_is_the_solid(model, found)


@pytest.mark.parametrize(("name", "most"), [("l-block", 2), ("bridge", 3), ("pocketed", 5)])
def test_simple_notches_give_the_fewest_parts(name, most):
    model = oracles.model(name)
    found = worked_out_parts(model)
    assert len(found.parts) == most
    assert_union_is_the_solid(model, found)


def test_a_hole_through_a_block_stays_a_hole():
    model = oracles.model("holed")
    found = worked_out_parts(model)
    assert len(found.parts) == 4
    assert not in_parts(found.parts, np.array([[1.6, 1.75, z] for z in (0.0, 0.5, 1.0)])).any()
    assert_union_is_the_solid(model, found)


def test_a_void_inside_a_block_stays_a_void():
    model = hollow_block()
    found = worked_out_parts(model)
    assert len(found.parts) == 6
    assert_union_is_the_solid(model, found)


def test_bodies_apart_are_parts_of_their_own():
    model = together(oracles.box(1, 1, 1), oracles.box(1, 2, 1).apply_translation([3, 0, 0]))
    found = worked_out_parts(model)
    assert len(found.parts) == 2
    assert_union_is_the_solid(model, found)


@pytest.mark.parametrize("seed", CSG_SEEDS)
def test_the_parts_of_a_random_solid_fill_it_and_nothing_else(seed):
    model = random_csg(seed)
    found = worked_out_parts(model)
    assert found.stray <= 1e-8 * model.diameter
    assert part_volumes(found.parts) == pytest.approx(
        float(oracles.mesh_of(model).volume), rel=1e-7
    )
    assert_union_is_the_solid(model, found)


def test_the_random_solids_are_hard_enough():
    notches = [len(convex_cuts.reflex_edges(random_csg(seed))[0]) for seed in CSG_SEEDS]
    genus = [
        1 - trimesh.Trimesh(m.vertices, m.triangles, process=False).euler_number / 2
        for m in map(random_csg, CSG_SEEDS)
    ]
    assert np.median(notches) >= 10
    assert max(notches) >= 40
    assert max(genus) >= 1


@pytest.mark.parametrize("name", convex_solids())
def test_a_convex_solid_is_its_own_part(name):
    model = convex_solids()[name]
    (part,) = worked_out_parts(model).parts
    assert {tuple(corner) for corner in part.vertices} <= {tuple(v) for v in model.vertices}
    assert part_volumes((part,)) == pytest.approx(float(oracles.mesh_of(model).volume), rel=1e-9)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
@pytest.mark.parametrize("name", ["housing", "pocketed"])
def test_size_and_attitude_make_no_difference(name, scale):
    model = replace(oracles.model(name), name="mine")
    turned = remade(model, scale * ROTATION.apply(model.vertices.copy()))
    found = worked_out_parts(turned)
    assert len(found.parts) == len(worked_out_parts(model).parts)
    assert found.stray <= 1e-9 * turned.diameter
    assert_union_is_the_solid(turned, found)


@pytest.mark.parametrize("name", [*STAND_IN_NAMES, "holed", "hull-20"])
def test_coordinates_in_single_precision_cost_only_what_they_round(name):
    model = replace(oracles.model(name), name="mine")
    rounded = remade(model, ROTATION.apply(model.vertices.copy()).astype(np.float32).astype(float))
    found = worked_out_parts(rounded)
    assert found.stray <= 2e-6 * rounded.diameter
    assert len(found.parts) <= len(worked_out_parts(model).parts) + 1
    assert_union_is_the_solid(rounded, found)


@pytest.mark.parametrize("name", ["my stapler", "holed"])
def test_mujoco_meets_the_parts_where_geometry_meets_the_mesh(name):
    model = user_mesh("stapler") if name == "my stapler" else oracles.model(name)
    spec = mujoco.MjSpec()
    for row, part in enumerate(worked_out_parts(model).parts):
        mesh = spec.add_mesh(name=f"part{row}")
        mesh.uservert = part.vertices.astype(np.float32).ravel()
        mesh.userface = part.triangles.astype(np.int32).ravel()
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"part{row}")
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    rng = np.random.default_rng(1)
    away = rng.normal(size=(300, 3))
    away *= 2.0 * model.diameter / np.linalg.norm(away, axis=1, keepdims=True)
    starts = model.centroid + away
    ends = rng.uniform(model.vertices.min(axis=0), model.vertices.max(axis=0), (300, 3))
    directions = (ends - starts) / np.linalg.norm(ends - starts, axis=1, keepdims=True)
    hits = cast_rays(model, RigidTransform.identity(), starts, directions)
    geom = np.empty(1, np.int32)
    depths = np.array(
        [
            mujoco.mj_ray(compiled, data, start, direction, None, True, -1, geom, None)
            for start, direction in zip(starts, directions, strict=True)
        ]
    )
    assert hits.hit.sum() > 100
    assert np.array_equal(depths >= 0, hits.hit)
    assert np.allclose(depths[hits.hit], hits.distances[hits.hit], atol=1e-5 * model.diameter)


def test_a_mesh_of_a_stand_ins_name_is_taken_for_what_it_is():
    model = replace(oracles.model("l-block"), name="housing")
    found = worked_out_parts(model)
    assert len(found.parts) == 2
    assert_union_is_the_solid(model, found)
