"""The search of an outline that tests name, and the poses that single interpretations have."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from oracles.outlines import entry

from palpate.recognizer import (
    Constraints,
    Contacts,
    Hypothesis,
    PoseTolerance,
    Search,
    SearchLimits,
)
from palpate.recognizer.beliefs.model_search import search_model
from palpate.recognizer.poses.entry import OutlineEntry
from palpate.recognizer.poses.fits.pose import Poses
from palpate.recognizer.poses.known import Surroundings
from palpate.recognizer.poses.pose_search import Aim, find_poses, test_interpretations

Floats = NDArray[np.float64]


def search(name: str, contacts: Contacts, **limits: int) -> tuple[list[Hypothesis], Floats, Search]:
    """What is found of an outline with the usual constraints, see `search_model`."""
    return search_model(
        entry(name), contacts, Constraints(), PoseTolerance(), SearchLimits(**limits)
    )


def fit(outline: OutlineEntry, rows: NDArray[np.int32], contacts: Contacts) -> Poses:
    """The poses of some interpretations, each looked for alone: of those that have any."""
    contacts = outline.in_space(contacts)
    aim = _aim(outline, contacts)
    none = np.zeros((0, len(contacts)), np.int32)
    parts = [test_interpretations(outline, row, contacts, aim) for row in (none, *rows[:, None])]
    return Poses.join(parts)


def components(outline: OutlineEntry, row: NDArray[np.integer], contacts: Contacts) -> Poses:
    """A pose of each component of the poses that one interpretation has."""
    contacts = outline.in_space(contacts)
    nothing = Surroundings.of(None, None)
    aim, only = _aim(outline, contacts), row[None].astype(np.int32)
    return find_poses(outline, contacts, aim, nothing, only).poses


def _aim(outline: OutlineEntry, contacts: Contacts) -> Aim:
    tolerance = PoseTolerance()
    shift = tolerance.distance(outline.model.diameter, float(contacts.position_error.max()))
    return Aim(Constraints(), SearchLimits(nodes=20_000), tolerance.rotation, shift)


def angles_of(rotations: Floats) -> Floats:
    """The angles of rotations (..., 3, 3) about z, after a look that they are such."""
    assert not rotations[..., 2, :2].any()
    assert not rotations[..., :2, 2].any()
    assert (np.abs(rotations[..., 2, 2] - 1.0) < 1e-14).all()
    return np.arctan2(rotations[..., 1, 0], rotations[..., 0, 0])
