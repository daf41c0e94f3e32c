"""Volumes of the pose sets that interpretations stand for, approximated locally.

An error ellipsoid has least squares' volume. Bounds on places beside a face's edges aren't
information to least squares, and normals hold a turn by their cone's width at most, so that an
ellipsoid may reach far beyond what bounds allow: it is cut along each axis to what they do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .contacts import Contacts
from .pose import ModelTest, Poses, kernel_contacts
from .volume_kernels import reach_along

Floats = NDArray[np.float64]

EVEN = 12.0**0.5
"""How many of its standard deviations an even spread is wide."""
LEAST = 1e-3
"""The least that a cut leaves of an axis: a pose in a corner of what bounds allow isn't alone."""


def error_ellipsoids(poses: Poses, radius: float) -> tuple[Floats, Floats]:
    """Of each interpretation, with half a turn and half a diameter known beforehand.

    Args:
        poses: m interpretations.
        radius: half the object's diameter, metres.

    Returns:
        (m, 6) variances along its axes, square metres, and (m, 6, 6) the axes, unit motions in
        columns: rotation about the centroid times the radius, then shift, in the object's frame.
    """
    precisions, axes = np.linalg.eigh(poses.informations + np.diag(_beforehand(radius) ** -2.0))
    return 1.0 / precisions, axes


def log_cuts(test: ModelTest, poses: Poses, contacts: Contacts) -> Floats:
    """How much of each interpretation's error ellipsoid its bounds leave.

    Args:
        test: of the object.
        poses: m interpretations.
        contacts: what they are of.

    Returns:
        (m,) logarithms of shares of the volumes, at most zero.
    """
    variances, axes = error_ellipsoids(poses, test.radius)
    reaches = np.empty_like(variances)
    reach_along(
        poses.faces,
        poses.rotations,
        poses.translations,
        kernel_contacts(contacts),
        contacts.normal_error,
        test.model,
        test.features.half_angles,
        np.ascontiguousarray(axes.transpose(0, 2, 1)),
        0.5 * EVEN * _beforehand(test.radius),
        reaches,
    )
    return np.log(np.clip(reaches / (EVEN * np.sqrt(variances)), LEAST, 1.0)).sum(axis=1)


def _beforehand(radius: float) -> Floats:
    """(6,) standard deviations of motions before any contact, metres."""
    return np.array([np.pi * radius] * 3 + [radius] * 3)
