"""A rival that others made: small_gicp's ICP from points to planes, from the starts of our own.

K. Koide, "small_gicp: Efficient and parallel algorithms for point cloud registration", Journal of
Open Source Software 9 (100), 6948, 2024. It takes clouds of points, so that a contact's normal is
told by four points more, around the contact in the plane that was felt. Of all starts, the one that
ends with the least error is the answer.
"""

from __future__ import annotations

import numpy as np
import small_gicp
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ....recognizer import Contacts, Polyhedron
from .icp_baseline import FINE, STARTS, IcpFit, super_fibonacci, surface_samples

Floats = NDArray[np.float64]

STEPS = 40
SETTLED = 1e-4
"""Radians, and half diameters, that a last step may move."""
REACH = 10.0
"""Half diameters within which a point finds its neighbour: wherever it is."""
NEIGHBOURS = 10
"""Samples that a normal of the surface is estimated from."""
PATCH = 2.0
"""How far out the four points are: where the standard deviation of a normal lifts them by so many
of a position's. Of 40 cases each of the housing (16 contacts) and the stapler (8), 0.05 in, π/10,
PATCH of 1, 2, 4 gets 70, 78, 40 % and 38, 48, 25 % right; a sixth of the samples, 62 and 32 %, and
no points around a contact, 35 % of the housing's."""


class SmallGicp:
    """Fits one object's pose to contacts whose errors are of a given size."""

    def __init__(self, model: Polyhedron, *, position_error: float, normal_error: float) -> None:
        """Sample the surface.

        Args:
            model: the object.
            position_error: bound on positions, metres.
            normal_error: bound on normals, radians.
        """
        self._centre, self._unit = model.centroid, model.diameter / 2.0
        points = (surface_samples(model, FINE)[0] - self._centre) / self._unit
        self._surface = small_gicp.PointCloud(points)
        self._tree = small_gicp.KdTree(self._surface)
        small_gicp.estimate_normals(self._surface, self._tree, num_neighbors=NEIGHBOURS)
        self._starts = np.tile(np.eye(4), (STARTS, 1, 1))
        self._starts[:, :3, :3] = Rotation.from_quat(super_fibonacci(STARTS)).as_matrix()
        self._starts[:, :3, 3] = points.mean(axis=0)
        # Standard deviations are those of the other baseline.
        self._radius = PATCH * (position_error / np.sqrt(5.0)) / (normal_error / 2.0)

    def fit(self, contacts: Contacts, near: RigidTransform | None = None) -> IcpFit:
        """The pose that fits best; its residual is a sum of squares in half diameters.

        Args:
            contacts: at least one, all with normals.
            near: the only start, model to world; None for many, over all rotations.
        """
        middle, starts = contacts.positions.mean(axis=0), self._starts
        if near is not None:
            shift = (near.inv().apply(middle) - self._centre) / self._unit
            start = RigidTransform.from_components(shift, near.rotation.inv())
            starts = start.as_matrix()[None]
        felt = small_gicp.PointCloud((self._patches(contacts) - middle) / self._unit)
        fits = [self._refine(felt, start) for start in starts]
        best = min(fits, key=lambda fit: fit.error)
        turn, shift = best.T_target_source[:3, :3].T, best.T_target_source[:3, 3]
        corner = middle - turn @ (self._centre + self._unit * shift)
        pose = RigidTransform.from_components(corner, Rotation.from_matrix(turn))
        return IcpFit(pose, float(best.error))

    def _patches(self, contacts: Contacts) -> Floats:
        """(5 n, 3) contacts, and around each four points in the plane that was felt; world."""
        least = np.eye(3)[np.abs(contacts.normals).argmin(axis=1)]
        u: Floats = np.cross(contacts.normals, least)
        u *= self._radius / np.linalg.norm(u, axis=1, keepdims=True)
        v: Floats = np.cross(contacts.normals, u)
        at = contacts.positions
        return np.concatenate([at, at + u, at - u, at + v, at - v])

    def _refine(self, felt: small_gicp.PointCloud, start: Floats) -> small_gicp.RegistrationResult:
        return small_gicp.align(
            self._surface,
            felt,
            self._tree,
            start,
            registration_type="PLANE_ICP",
            max_correspondence_distance=REACH,
            max_iterations=STEPS,
            rotation_epsilon=SETTLED,
            translation_epsilon=SETTLED,
        )
