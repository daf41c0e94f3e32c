"""The rotational symmetries of a model, found from its faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

LENGTH_TOLERANCE = 1e-4
"""How far a corner may miss its image, as a share of the diameter.

Coordinates in single precision are good to 1e-6 or so; a difference of 1e-4 is far below what
a touch resolves. Poses that differ by an approximate symmetry this close count as one.
"""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FaceSummary:
    """What a symmetry has to preserve of each face, relative to the solid's centroid."""

    normals: Floats
    """(f, 3) outward unit normals."""
    offsets: Floats
    """(f,) distances of the planes from the centroid."""
    areas: Floats
    """(f,) areas."""
    middles: Floats
    """(f, 3) centres of area."""


def rotational_symmetries(faces: FaceSummary, corners: Floats, diameter: float) -> Floats:
    """The proper rotations about the centroid that map a solid onto itself.

    A symmetry sends two faces with different normals to two faces that look alike, and that fixes
    it; so the pairs that look like one rare pair give all candidates, each checked in full.

    Args:
        faces: the solid's faces.
        corners: (c, 3) the solid's corners, relative to its centroid.
        diameter: the solid's diameter.

    Returns:
        (g, 3, 3) rotation matrices, the identity first.
    """
    slack = LENGTH_TOLERANCE * diameter
    alike = (
        (np.abs(faces.offsets[:, None] - faces.offsets) < slack)
        & (np.abs(faces.areas[:, None] - faces.areas) < slack * diameter)
        & (np.abs(_lengths(faces.middles)[:, None] - _lengths(faces.middles)) < slack)
    )
    cosines = faces.normals @ faces.normals.T
    first = int(alike.sum(axis=1).argmin())
    # The more the two lean apart, the better they fix a frame; in a flat solid no two do by much.
    sines = np.linalg.norm(np.cross(faces.normals[first], faces.normals), axis=1)
    slanted = sines > 0.5 * sines.max()
    second = int(np.where(slanted, alike.sum(axis=1), len(alike) + 1).argmin())
    frame = leaning_frame(faces.normals[first], faces.normals[second])
    tree = KDTree(corners)
    found = [np.eye(3)]
    for image in np.flatnonzero(alike[first]):
        fits = alike[second] & (np.abs(cosines[image] - cosines[first, second]) < 1e-3)
        for other in np.flatnonzero(fits):
            rotation = leaning_frame(faces.normals[image], faces.normals[other]) @ frame.T
            new = all(np.abs(rotation - known).max() > 1e-3 for known in found)
            if new and _maps_onto_itself(rotation, faces, alike, tree, slack):
                found.append(rotation)
    return np.array(found)


def _maps_onto_itself(
    rotation: Floats, faces: FaceSummary, alike: NDArray[np.bool_], corners: KDTree, slack: float
) -> bool:
    points = np.asarray(corners.data)
    distances, images = (np.atleast_1d(found) for found in corners.query(points @ rotation.T))
    if distances.max() > slack or len(np.unique(images)) != len(images):
        return False
    turned = faces.normals @ rotation.T @ faces.normals.T
    apart = np.linalg.norm((faces.middles @ rotation.T)[:, None] - faces.middles, axis=2)
    # A middle is as good as the corners it is averaged from, up to the shape of the face.
    matches = alike & (turned > 1.0 - 1e-4) & (apart < 10.0 * slack)
    return bool(matches.any(axis=1).all() and matches.any(axis=0).all())


def leaning_frame(a: Floats, b: Floats) -> Floats:
    """A right-handed orthonormal frame, in columns, that leans on two directions."""
    across = np.cross(a, b)
    across /= np.linalg.norm(across)
    return np.column_stack([a, across, np.cross(a, across)])


def _lengths(vectors: Floats) -> Floats:
    return np.linalg.norm(vectors, axis=1)
