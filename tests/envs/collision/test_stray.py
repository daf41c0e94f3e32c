"""How far collision parts stray from the mesh: no farther than they say, or they are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from oracles import solids as oracles
from oracles.convex_parts import (
    ROTATION,
    hollow_block,
    in_parts,
    remade,
    resized,
    together,
    user_mesh,
)
from oracles.geometry import windings

from palpate.assets import ConvexPart, load_parts
from palpate.envs.collision import collision, convex_cuts
from palpate.envs.collision.collision import MOST_STRAY, worked_out_parts
from palpate.envs.collision.parts_check import stray
from palpate.recognizer import Polyhedron


@pytest.mark.parametrize("share", [-3e-6, -4e-8, 0.0, 2e-8, 5e-7, 1e-6])
def test_the_stray_of_a_box_too_large_or_too_small_is_that_of_its_corners(share):
    model = oracles.model("cube")
    (part,) = worked_out_parts(model).parts
    off = abs(share) * model.diameter / 2.0
    bound = stray(model, [resized(part, share)])
    assert bound is not None
    # The next step of 1, 2, 5, 10 above the truth.
    assert off <= bound <= max(2.6 * off, 1.01e-9 * model.diameter)


@pytest.mark.parametrize("name", ["housing", "complex-hand"])
def test_no_point_of_a_rounded_solid_is_farther_off_than_the_stray(name):
    model = replace(oracles.model(name), name="mine")
    rounded = remade(model, ROTATION.apply(model.vertices.copy()).astype(np.float32).astype(float))
    found = worked_out_parts(rounded)
    rng = np.random.default_rng(2)
    on_mesh = oracles.points_on(rounded, rng.integers(len(rounded.triangles), size=300), rng)
    grown = []
    for part in found.parts:
        middle = part.vertices.mean(axis=0)
        reach = np.linalg.norm(part.vertices - middle, axis=1).max()
        grown.append(resized(part, 1.001 * found.stray / reach))
        corners = part.vertices[part.triangles[rng.integers(len(part.triangles), size=100)]]
        on_part = np.einsum("nk,nkd->nd", rng.dirichlet(np.ones(3), 100), corners)
        pulled_in = on_part - 1.001 * found.stray / reach * (on_part - middle)
        assert (windings(rounded.vertices[rounded.triangles], pulled_in) > 0.5).all()
    assert in_parts(tuple(grown), on_mesh).all()


def test_a_part_missing_too_large_or_out_of_place_is_noticed():
    model = oracles.model("housing")
    own = load_parts("housing")
    assert stray(model, own) is not None
    assert stray(model, ()) is None
    for row in range(len(own)):
        others = own[:row] + own[row + 1 :]
        assert stray(model, others) is None
        assert stray(model, (*others, resized(own[row], 1e-3))) is None
        shifted = ConvexPart(
            own[row].vertices + [0.0, 3e-5 * model.diameter, 0.0], own[row].triangles
        )
        assert stray(model, (*others, shifted)) is None


@pytest.mark.parametrize("name", ["l-block", "holed", "pocketed", "bridge"])
def test_a_hull_that_fills_a_notch_or_a_hole_is_noticed(name):
    model = oracles.model(name)
    hull = trimesh.convex.convex_hull(model.vertices)
    part = ConvexPart(np.array(hull.vertices), np.array(hull.faces))
    assert stray(model, (*worked_out_parts(model).parts, part)) is None


def test_a_thin_slit_is_not_bridged():
    """Narrower than any grid of sample points would see."""
    gap = 1e-4
    model = Polyhedron.from_mesh(
        oracles.blocks(
            [[[1], [1]], [[1], [0]], [[1], [1]]], [0, 1, 1 + gap, 2], [0, 0.5, 2], [0, 1]
        ),
        name="slit",
    )
    found = worked_out_parts(model)
    assert not in_parts(found.parts, np.array([[1 + gap / 2, 1.0, 0.5]])).any()
    filled = oracles.box(2, 2, 1)
    part = ConvexPart(np.array(filled.vertices), np.array(filled.faces))
    assert stray(model, (part,)) is None


def test_a_mesh_that_crosses_itself_is_refused_with_what_to_do():
    other = oracles.box(1, 1, 1).apply_translation([0.5, 0.4, 0.3])
    crossed = together(oracles.box(1, 1, 1), other)
    with pytest.raises(ValueError, match=r"two: its convex parts stray.*mend a mesh"):
        worked_out_parts(crossed)


def test_a_decomposition_that_leaves_a_void_is_refused(monkeypatch):
    """Its surface is all there, and only the volume tells."""
    solid = Polyhedron.from_mesh(oracles.box(0.04, 0.04, 0.04), name="solid")
    around_a_void = convex_cuts.convex_cuts(hollow_block())
    assert stray(solid, [hull.part for hull in around_a_void]) is not None
    monkeypatch.setattr(collision, "_convex_whole", lambda model: [])
    monkeypatch.setattr(convex_cuts, "convex_cuts", lambda model: around_a_void)
    with pytest.raises(ValueError, match="stray"):
        worked_out_parts(solid)


def test_too_intricate_a_solid_is_refused(monkeypatch):
    monkeypatch.setattr(convex_cuts, "MOST_CELLS", 10)
    with pytest.raises(ValueError, match=r"more than 10 convex cells.*coarser mesh"):
        worked_out_parts(user_mesh("housing"))


def test_the_limit_is_the_one_stated():
    assert MOST_STRAY == 1e-5
