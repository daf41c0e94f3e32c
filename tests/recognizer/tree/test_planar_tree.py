"""The tree in the plane: its masks, its leaves, and how many there are (memo, Section 4.1)."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.constraints import NAMES, compiled_masks, only
from oracles.outlines import (
    INCH,
    SMALL,
    entry,
    felt_outline,
    pair_margins,
    turned,
    unrelated_in_plane,
)
from oracles.solids import as_set, enumerate_interpretations

from palpate.recognizer import Constraints, Contacts
from palpate.recognizer.models.polygon import Polygon
from palpate.recognizer.tree.planar_mask_kernels import pair_masks
from palpate.recognizer.tree.tree import prune, spread_order

CHOICES = [(name,) for name in NAMES] + [NAMES[:3], NAMES]
small_shape = pytest.mark.parametrize("name", SMALL)
every_choice = pytest.mark.parametrize("chosen", CHOICES, ids="+".join)


@every_choice
@pytest.mark.parametrize("name", ["square", "comb", "70-gon", "hand"])
def test_masks_are_those_of_the_formulas(name, chosen):
    tables = entry(name).tables
    compared = borderline = kept = 0
    for seed in range(3):
        for contacts in (
            unrelated_in_plane(name, 4, seed),
            felt_outline(
                name, 4, seed, awkward=True, dist=0.05, at_bounds=True, missing=0.2
            ).contacts,
        ):
            found = compiled_masks(pair_masks, entry(name).tables, contacts, only(chosen))
            left = np.ones((len(contacts), tables.face_count), bool)
            for j in range(len(contacts)):
                for i in range(j):
                    margins = pair_margins(tables, contacts, i, j, chosen)
                    # Edges of j that no partner before i supports are dropped, and rows of i.
                    expected = (margins >= 0.0) & left[i][:, None] & left[j]
                    # The oracle's sampled cone misses extremes by less than this.
                    clear = np.abs(margins) > 1e-7
                    np.testing.assert_array_equal(found[i, j][clear], expected[clear])
                    left[j] &= found[i, j].any(axis=0)
                    compared += clear.size
                    borderline += int((~clear).sum())
                    kept += int(expected.sum())
    assert borderline < 0.05 * compared
    assert 0 < kept <= compared


@every_choice
@small_shape
def test_leaves_are_all_assignments_that_fit(name, chosen):
    for seed in range(3):
        for contacts in (
            unrelated_in_plane(name, 4, seed),
            felt_outline(name, 4, seed, awkward=True, dist=0.03, missing=0.3).contacts,
        ):
            expected = as_set(
                enumerate_interpretations(entry(name).tables, contacts, chosen, pair_margins)
            )
            for sort in (False, True):
                found = prune(entry(name).tables, contacts, constraints=only(chosen), sort=sort)
                assert found.complete
                assert as_set(found.faces) == expected
                assert len(found.faces) == len(expected)


def test_a_mirror_image_is_another_outline_for_the_signed_angles_only():
    mirror = np.array([-1.0, 1.0])
    contacts = felt_outline("l-shape", 4, 2, dist=1e-3, normal=0.05).contacts
    flipped = Contacts(
        contacts.positions * mirror,
        contacts.normals * mirror,
        position_error=contacts.position_error,
        normal_error=contacts.normal_error,
    )
    tables = entry("l-shape").tables
    assert len(prune(tables, contacts).faces) > 0
    assert len(prune(tables, flipped).faces) == 0
    unsigned = Constraints(angle=False)
    assert as_set(prune(tables, contacts).faces) <= as_set(
        prune(tables, flipped, constraints=unsigned).faces
    )


def sense_star(model: Polygon, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Where five evenly spaced directions from the centroid leave the outline at last."""
    points, edges = [], []
    for angle in rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(5) / 5:
        direction = np.array([np.cos(angle), np.sin(angle)])
        starts = model.segments[:, 0] - model.centroid
        along = model.segments[:, 1] - model.segments[:, 0]
        facing = direction[0] * along[:, 1] - direction[1] * along[:, 0]
        depths = (starts[:, 0] * along[:, 1] - starts[:, 1] * along[:, 0]) / facing
        shares = (starts[:, 0] * direction[1] - starts[:, 1] * direction[0]) / facing
        depths = np.where((shares >= 0) & (shares <= 1), depths, -np.inf)
        edges.append(int(depths.argmax()))
        points.append(model.centroid + depths.max() * direction)
    return np.array(points), np.array(edges)


@pytest.mark.parametrize(
    ("name", "with_direction", "without"), [("wrench", 2, 48), ("gator", 4, 12), ("hand", 4, 9)]
)
def test_counts_are_of_the_order_of_table_1(name, with_direction, without):
    """Medians of 250 runs (Section 4.1), on stand-ins of which the wrench alone was fitted."""
    model, tables, rng = entry(name).model, entry(name).tables, np.random.default_rng(738)
    counts = []
    for _ in range(250):
        points, edges = sense_star(model, rng)
        # A direction and a magnitude at random, as the memo says: not uniform in the disc.
        around, far = rng.uniform(0, 2 * np.pi, 5), 0.1 * INCH * rng.random(5)
        noise = far[:, None] * np.column_stack([np.cos(around), np.sin(around)])
        contacts = Contacts(
            points + noise,
            turned(model.normals[edges], rng.uniform(-np.pi / 8, np.pi / 8, 5)),
            position_error=0.1 * INCH,
            normal_error=np.pi / 8,
        )
        kept = prune(tables, contacts)
        assert (kept.faces == edges).all(axis=1).any()
        without_it = prune(tables, contacts, constraints=Constraints(component=False))
        counts.append((len(kept.faces), len(without_it.faces)))
    medians = np.median(counts, axis=0)
    assert with_direction / 2 <= medians[0] <= 2 * with_direction
    assert without / 2 <= medians[1] <= 2 * without
    assert min(counts)[0] == len(model.symmetries)


def test_contacts_are_sorted_in_the_plane_too():
    case = felt_outline("hand", 9, 1)
    order = spread_order(case.contacts)
    assert sorted(order.tolist()) == list(range(9))
