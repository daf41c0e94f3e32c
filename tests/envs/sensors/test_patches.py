"""Planes through patches of readings, and the bound on a face's normal that a patch gives.

True bounds of planes come from scipy's linear programs.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from oracles import solids as oracles
from scipy.optimize import linprog
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES
from palpate.envs.sensors.patch_bounds import GRID, MIDDLE, normal_bound, possible_slopes
from palpate.envs.sensors.patches import (
    ARM,
    SIDE,
    best_of_blocks,
    fit_patches,
    patch_residuals,
    spread_out,
)
from palpate.envs.sensors.range_points import FLAT
from palpate.envs.sensors.range_sensor import COARSEST, SHORTEST_EDGE
from palpate.recognizer import Polyhedron
from palpate.recognizer.models.rays import cast_rays

SPACING = (4e-4, 8e-4)
"""Of readings, along columns and rows, metres."""


def test_planes_through_patches_are_those_of_least_squares():
    rng = np.random.default_rng(1)
    depths = rng.normal(size=(9, 8))
    fits = fit_patches(depths)
    for i, j in np.ndindex(5, 4):
        patch = depths[i : i + SIDE, j : j + SIDE].ravel()
        design = np.column_stack([GRID, np.ones(len(GRID))])
        plane = np.linalg.lstsq(design, patch)[0]
        assert np.allclose([*fits.slopes[i, j], fits.heights[i, j]], plane)
        residuals = patch - design @ plane
        assert np.allclose(patch_residuals(depths, fits, (i, j)).ravel(), residuals)
        assert fits.residuals[i, j] == pytest.approx(np.abs(residuals).max())


def test_a_patch_is_as_flat_as_the_worst_of_its_neighbours():
    rng = np.random.default_rng(2)
    depths = rng.normal(size=(12, 11))
    depths[0, 0] = np.nan
    fits = fit_patches(depths)
    flatness = fits.flatness
    assert np.isinf(flatness[[0, -1]]).all()
    assert np.isinf(flatness[:, [0, -1]]).all()
    assert np.isinf(flatness[1, 1])
    assert flatness[3, 4] == fits.residuals[2:5, 3:6].max()


def test_chosen_patches_are_flat_and_do_not_overlap_within_a_block():
    rng = np.random.default_rng(3)
    fits = fit_patches(rng.normal(size=(60, 50)))
    chosen = best_of_blocks(fits, 2.2)
    assert len(chosen) > 10
    assert (fits.flatness[tuple(chosen.T)] <= 2.2).all()
    assert len(np.unique(chosen // SIDE, axis=0)) == len(chosen)
    residuals = fits.residuals[tuple(chosen.T)]
    assert (np.diff(residuals) >= 0.0).all()


def test_places_are_chosen_with_independent_normals_and_then_far_apart():
    points = np.column_stack([np.arange(10.0), np.zeros(10), np.zeros(10)])
    normals = np.tile([0.0, 0.0, 1.0], (10, 1))
    normals[4] = [0.0, 1.0, 0.0]
    normals[7] = [1.0, 0.0, 0.0]
    chosen = spread_out(points, normals, 5, lambda row: True)
    assert chosen[0] == 0
    assert set(chosen[1:3]) == {4, 7}
    assert chosen[3] == 2
    asked = []
    assert 4 not in spread_out(points, normals, 10, lambda row: bool(asked.append(row) or row != 4))
    assert sorted(asked) == list(range(10))


def quarters() -> list[np.ndarray]:
    """Masks of the readings in right angles with their corner in the middle, every half degree."""
    bearings = np.degrees(np.arctan2(GRID[:, 1], GRID[:, 0]))
    masks = {}
    for first in np.arange(0.25, 360.0, 0.5):
        mask = (bearings - first) % 360.0 <= 90.0
        mask[MIDDLE] = True
        masks[mask.tobytes()] = mask
    return list(masks.values())


def steepest_by_linear_program(low, high, towards) -> float:
    """The largest slope of a plane between two bounds, in a direction; minus infinity for none."""
    design = np.column_stack([GRID, np.ones(len(GRID))])
    upper, lower = np.isfinite(high), np.isfinite(low)
    found = linprog(
        -np.append(towards, 0.0),
        A_ub=np.concatenate([design[upper], -design[lower]]),
        b_ub=np.concatenate([high[upper], -low[lower]]),
        bounds=[(None, None)] * 3,
    )
    return -found.fun if found.status == 0 else -np.inf


def test_possible_slopes_are_those_of_linear_programs():
    rng, infinite = np.random.default_rng(4), np.full(len(GRID), np.inf)
    for _ in range(4):
        depths = rng.uniform(-1.0, 1.0, (SIDE, SIDE))
        residuals = patch_residuals(depths, fit_patches(depths), (0, 0))
        slopes = possible_slopes(residuals, 1.0)
        low, high = residuals.ravel() - 1.0, residuals.ravel() + 1.0
        middle = np.arange(len(GRID)) == MIDDLE
        cases = [(np.where(q, low, -infinite), np.where(q, high, infinite)) for q in quarters()]
        cases += [(np.where(middle, low, -infinite), high), (low, np.where(middle, high, infinite))]
        assert len(cases) == 18
        for bearing in rng.uniform(0.0, 2.0 * np.pi, 3):
            towards = np.array([np.cos(bearing), np.sin(bearing)])
            wanted = max(steepest_by_linear_program(*case, towards) for case in cases)
            assert (slopes @ towards).max() == pytest.approx(wanted, abs=1e-5)


def angle(slopes, others) -> float:
    u, v = np.append(slopes / np.array(SPACING), 1.0), np.append(others / np.array(SPACING), 1.0)
    return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))


def plane_at(slopes) -> np.ndarray:
    """(25,) a plane through zero in the middle of a patch."""
    return GRID @ slopes


def surfaces(rng: np.random.Generator):
    """Patches of two to five faces: depths, and slopes of the face in the middle."""
    scale = 10.0 ** rng.uniform(-2.0, 0.5)
    own = scale * rng.normal(size=2)
    others = scale * rng.normal(size=(4, 2))
    heights = 0.3 * scale * rng.random(4)
    further = np.array([plane_at(s) for s in others])
    kind = rng.integers(3)
    if kind == 0:  # bulging: no other face is before the one in the middle, there
        return np.maximum(plane_at(own), (further - heights[:, None]).max(axis=0)), own
    if kind == 1:
        return np.minimum(plane_at(own), (further + heights[:, None]).min(axis=0)), own
    shown = quarters()[rng.integers(16)]
    return np.where(shown, plane_at(own), rng.normal(size=len(GRID)) * scale), own


def test_the_face_in_the_middle_is_within_the_bound_whatever_else_a_patch_shows():
    """Noise is at its worst: it hides the other faces as far as it can."""
    rng, error, close = np.random.default_rng(5), 1e-2, 0.0
    design = np.column_stack([GRID, np.ones(len(GRID))])
    for _ in range(500):
        depths, own = surfaces(rng)
        fitted = design @ np.linalg.lstsq(design, depths)[0]
        noise = np.clip(fitted - depths, -error, error)
        if rng.random() < 0.5:
            noise = error * rng.choice([-1.0, 1.0], len(GRID))
        read = (depths + noise).reshape(SIDE, SIDE)
        fits = fit_patches(read)
        slopes = fits.slopes[0, 0]
        bound = normal_bound(slopes, patch_residuals(read, fits, (0, 0)), SPACING, error)
        assert angle(slopes, own) <= bound
        close = max(close, angle(slopes, own) / bound)
    assert close > 0.8  # the bound is not much wider than it must be


def test_patches_that_no_noise_explains_are_unbounded():
    checkered = np.where(np.indices((SIDE, SIDE)).sum(axis=0) % 2 == 0, 10.0, -10.0)
    checkered[ARM, ARM] = 0.0
    assert normal_bound(np.zeros(2), checkered, SPACING, 1.0) == np.pi


def window_depths(solid: Polyhedron, rng: np.random.Generator, columns: int, rows: int):
    """Depths along rays straight down onto an edge or a corner of a solid, and the faces there."""
    pose = RigidTransform.from_components(np.zeros(3), Rotation.random(rng=rng))
    edge = solid.edges[rng.integers(len(solid.edges))]
    middle = pose.apply(edge[0] + rng.random() * rng.integers(2) * (edge[1] - edge[0]))
    at = middle[:2] + np.array(SPACING) * (
        np.indices((columns, rows)).reshape(2, -1).T - (columns // 2, rows // 2) + rng.random(2)
    )
    starts = np.column_stack([at, np.full(len(at), 0.5)])
    hits = cast_rays(solid, pose, starts, np.tile([0.0, 0.0, -1.0], (len(starts), 1)))
    depths = np.where(hits.hit, hits.distances, np.nan)
    normals = pose.rotation.apply(solid.normals.copy())[hits.faces]
    return depths.reshape(columns, rows), normals.reshape(columns, rows, 3)


def test_noise_made_to_hide_edges_hides_none_that_break_the_bound():
    """Small objects, near edges and corners, at the coarsest error and the shortest edges allowed.

    The noise makes each patch with its neighbours as flat as it can.
    """
    rng, error = np.random.default_rng(7), COARSEST * min(SPACING)
    places = np.indices((SIDE + 2, SIDE + 2)).reshape(2, -1).T - ARM - 1.0
    design = np.column_stack([places, np.ones(len(places))])
    fit = design @ np.linalg.pinv(design)
    hidden = 0
    for name in [*STAND_IN_NAMES, "hull-20", "bridge", "pocketed"]:
        solid = oracles.model(name)
        lengths = np.linalg.norm(solid.edges[:, 1] - solid.edges[:, 0], axis=1)
        scale = SHORTEST_EDGE * error / lengths.min()
        small = Polyhedron.from_mesh(
            trimesh.Trimesh(scale * solid.vertices, solid.triangles, process=False), name=name
        )
        for _ in range(50):
            depths, normals = window_depths(small, rng, 40, 30)
            flatness = fit_patches(depths).flatness
            mixed = (flatness <= 1.5 * (FLAT + 1.0) * error) & (flatness > 1e-9)
            for i, j in np.argwhere(mixed):
                window = depths[i - 1 : i + SIDE + 1, j - 1 : j + SIDE + 1]
                flat = (fit @ window.ravel()).reshape(window.shape)
                read = window + np.clip(flat - window, -error, error)
                fits = fit_patches(read)
                if fits.residuals.max() > FLAT * error:
                    continue
                residuals = patch_residuals(read, fits, (1, 1))
                bound = normal_bound(fits.slopes[1, 1], residuals, SPACING, error)
                normal = normals[i + ARM, j + ARM]
                true = normal[:2] / normal[2] * SPACING
                assert angle(fits.slopes[1, 1], true) <= bound, (name, i, j)
                hidden += 1
    assert hidden > 100
