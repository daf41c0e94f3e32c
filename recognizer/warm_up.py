"""Calls every kernel once, so that it is compiled; see `preparing`."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform

from .contacts.contacts import Contacts
from .models.polygon import Polygon
from .models.polyhedron import Polyhedron
from .models.rays import RayHits, cast_rays
from .predict.pose_samples import sample_belief
from .predict.prediction import predict
from .predict.probes import ProbeSpace
from .recognize import Recognizer
from .tree.tree import Constraints, prune


def recognize_solids() -> None:
    """Contacts, more contacts, contacts that leave one pose, and one that leaves a family."""
    contacts, recognizer = _few(), Recognizer([_box()])
    belief = recognizer.update(recognizer.recognize(contacts), contacts)
    # Contacts all around leave one pose, whose neighbours are looked at.
    sides = np.repeat(np.concatenate([np.eye(3), -np.eye(3)]), 3, axis=0)
    aside = 0.3 * np.sin(np.arange(54.0)).reshape(18, 3) * (sides == 0.0)
    hits = _hits(5.0 * sides + aside, -sides)
    recognizer.recognize(
        Contacts(hits.points_world, hits.normals_world, position_error=0.04, normal_error=0.1)
    )
    one = contacts[:1]
    recognizer.sample_poses(recognizer.recognize(one).hypotheses[0], one, 4)
    predict(sample_belief(belief, [_box()], 64), ProbeSpace(1.0, 5.0).rays(np.zeros((1, 3))))


def prune_alone() -> None:
    """The tree without poses, with triples too."""
    tables = Recognizer([_box()]).tables("box")
    prune(tables, _few())
    prune(tables, _few(), constraints=Constraints(triple=True, area=True))


def recognize_outlines() -> None:
    """One contact with a rectangle."""
    square = Polygon.from_corners([(0.0, 0.0), (1.0, 0.0), (1.0, 2.0), (0.0, 2.0)], name="square")
    flat = Contacts([(0.5, 0.0)], [(0.0, -1.0)], position_error=0.01, normal_error=0.1)
    recognizer = Recognizer([square])
    recognizer.sample_poses(recognizer.recognize(flat).hypotheses[0], flat, 4)


PARTS = (recognize_solids, recognize_outlines, prune_alone)
"""What can be compiled independently: the longest first, what shares most with it last."""


def _box() -> Polyhedron:
    import trimesh

    return Polyhedron.from_mesh(trimesh.creation.box((1.0, 2.0, 3.0)), name="box")


def _hits(starts: np.ndarray, directions: np.ndarray) -> RayHits:
    return cast_rays(_box(), RigidTransform.identity(), starts, directions)


def _few() -> Contacts:
    hits = _hits(5.0 * np.eye(3), -np.eye(3))
    return Contacts(hits.points_world, hits.normals_world, position_error=0.01, normal_error=0.1)
