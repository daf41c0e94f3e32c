"""Compile every kernel once, so that the first real call doesn't wait.

Run as `python -m palpate.recognizer.warm_up`.

numba keeps the compiled code beside the source, or in the user's cache where that is read-only.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform

from .contacts.contacts import Contacts
from .contacts.free_space import FreeSpace
from .contacts.support import SupportPlane
from .models.polygon import Polygon
from .models.polyhedron import Polyhedron
from .models.rays import cast_rays
from .poses.surroundings.repair import repair
from .poses.surroundings.surroundings import Surroundings, bounds_of
from .predict.pose_samples import sample_belief
from .predict.prediction import predict
from .predict.probes import ProbeSpace
from .recognize import Recognizer
from .tree.tree import Constraints, prune


def warm_up() -> None:
    """Run the recogniser and the predictor once on a box, the recogniser on a rectangle too."""
    import trimesh

    box = Polyhedron.from_mesh(trimesh.creation.box((1.0, 2.0, 3.0)), name="box")
    hits = cast_rays(box, RigidTransform.identity(), 5.0 * np.eye(3), -np.eye(3))
    contacts = Contacts(
        hits.points_world, hits.normals_world, position_error=0.01, normal_error=0.1
    )
    recognizer = Recognizer([box])
    belief = recognizer.update(recognizer.recognize(contacts), contacts)
    predict(sample_belief(belief, [box], 64), ProbeSpace(1.0, 5.0).rays(np.zeros((1, 3))))
    paths = FreeSpace(5.0 * np.eye(3), hits.points_world, error=0.01)
    floor = SupportPlane(height=-1.5, error=0.01, resting=True)
    best = recognizer.recognize(contacts, free_space=paths, support=floor).hypotheses[0]
    bounds = bounds_of(box, recognizer.features("box"), contacts, Surroundings.of(paths, floor))
    # A little off, so that there is something to repair.
    aside = best.pose.translation + [0.02, 0.0, 0.0]
    faces = best.interpretations[0].astype(np.int64)
    repair(faces, best.pose.rotation.as_matrix(), aside, bounds, steps=1)
    one = contacts[:1]
    recognizer.sample_poses(recognizer.recognize(one).hypotheses[0], one, 4)
    prune(recognizer.tables("box"), contacts)
    prune(recognizer.tables("box"), contacts, constraints=Constraints(triple=True, area=True))
    square = Polygon.from_corners([(0.0, 0.0), (1.0, 0.0), (1.0, 2.0), (0.0, 2.0)], name="square")
    # Contacts all around leave one pose, whose neighbours are looked at.
    sides = np.repeat(np.concatenate([np.eye(3), -np.eye(3)]), 3, axis=0)
    aside = 0.3 * np.sin(np.arange(54.0)).reshape(18, 3) * (sides == 0.0)
    hits = cast_rays(box, RigidTransform.identity(), 5.0 * sides + aside, -sides)
    around = Contacts(hits.points_world, hits.normals_world, position_error=0.04, normal_error=0.1)
    recognizer.recognize(around)
    flat = Contacts([(0.5, 0.0)], [(0.0, -1.0)], position_error=0.01, normal_error=0.1)
    flat_recognizer = Recognizer([square])
    flat_recognizer.sample_poses(flat_recognizer.recognize(flat).hypotheses[0], flat, 4)


if __name__ == "__main__":
    warm_up()
