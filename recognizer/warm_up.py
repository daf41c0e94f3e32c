"""Calls every kernel once, so that it is compiled; see `preparing`."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform

from .contacts.contacts import Contacts
from .contacts.free_space import FreeSpace
from .contacts.support import SupportPlane, stable_faces
from .models.features import face_features
from .models.polygon import Polygon
from .models.polyhedron import Polyhedron
from .models.rays import RayHits, cast_rays
from .poses.fits.pose import Poses
from .poses.surroundings.repair import repair
from .poses.surroundings.surroundings import Surroundings, bounds_of, clear
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


def hold_against_surroundings() -> None:
    """A pose beside free paths and a floor, and one to repair; without a search, which is another
    part's."""
    box, hits = _box(), _hits(5.0 * np.eye(3), -np.eye(3))
    features, contacts = face_features(box), _few()
    paths = FreeSpace(5.0 * np.eye(3), contacts.positions, error=0.01)
    surroundings = Surroundings.of(paths, SupportPlane(height=-1.5, error=0.01, resting=True))
    faces = hits.faces.astype(np.int32)[None]
    one, nothing = np.eye(3)[None], np.zeros((1, 3))
    poses = Poses(
        faces, one, nothing, np.zeros(1), np.eye(6)[None], np.ones(1, bool), np.zeros((1, 2))
    )
    clear(box, features, poses, contacts, surroundings, stable_faces(box)[0])
    bounds = bounds_of(box, features, contacts, surroundings)
    # A little off, so that there is something to repair.
    repair(hits.faces, np.eye(3), np.array([0.02, 0.0, 0.0]), bounds, steps=1)


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


PARTS = (recognize_solids, recognize_outlines, prune_alone, hold_against_surroundings)
"""What can be compiled independently: the longest first, what shares most with it last."""


def _box() -> Polyhedron:
    import trimesh

    return Polyhedron.from_mesh(trimesh.creation.box((1.0, 2.0, 3.0)), name="box")


def _hits(starts: np.ndarray, directions: np.ndarray) -> RayHits:
    return cast_rays(_box(), RigidTransform.identity(), starts, directions)


def _few() -> Contacts:
    hits = _hits(5.0 * np.eye(3), -np.eye(3))
    return Contacts(hits.points_world, hits.normals_world, position_error=0.01, normal_error=0.1)
