"""Is the true pose in a belief? Asked of the pose itself, contact by contact.

What every contact may lie on is worked out anew, from where the object truly is: a feature that is
within the contact's bound on position, has a normal within its bound on normals, faced the probe
and is of the kind that was told. The true pose is in a belief if some interpretation of the true
object has each contact on such a feature. How a simulation made the contacts doesn't enter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from oracles.geometry import angle_between, cone_angles, segment_distances, triangle_distances
from scipy.spatial.transform import RigidTransform, Rotation

from ....recognizer import ANYTHING, EDGE, FACE, VERTEX, Belief, Hypothesis, Polygon, Polyhedron
from ....recognizer.contacts.contacts import APPROACH_ERROR
from .case import Case
from .check import EXACT, ROUNDING, breaches, feature_of, symmetric_images

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

KIND_NUMBERS = {"face": FACE, "edge": EDGE, "vertex": VERTEX}


def possible_features(case: Case) -> Booleans:
    """(n, f) whether each contact may lie on each feature of the object, which is where it is."""
    if isinstance(case.model, Polygon):
        return _possible_edges(case, case.model)
    return _possible_features(case, case.model)


def true_hypotheses(case: Case, belief: Belief, possible: Booleans) -> list[Hypothesis]:
    """The hypotheses that the true pose, or a symmetric copy of it, is one of.

    Args:
        case: what was felt, and where the object truly is.
        belief: what the recogniser makes of it.
        possible: (n, f) what each contact may lie on, see `possible_features`.
    """
    images, rows = symmetric_images(case), np.arange(len(case.contacts))
    return [
        hypothesis
        for hypothesis in belief.hypotheses
        if hypothesis.object_name == case.model.name
        and _reaches_truth(case, hypothesis)
        and any(
            bool(possible[rows, image[hypothesis.interpretations]].all(axis=1).any())
            for image in images
        )
    ]


def _reaches_truth(case: Case, hypothesis: Hypothesis) -> bool:
    """Whether a hypothesis says that its poses reach as far as the true one, or a copy of it."""
    if isinstance(case.model, Polygon):
        return True
    turns = hypothesis.pose.rotation.inv() * case.truth.rotation
    symmetries = Rotation.from_matrix(case.model.symmetries)
    turn = float((turns * symmetries).magnitude().min())
    centre = case.model.centroid.copy()
    way = float(np.linalg.norm(hypothesis.pose.apply(centre) - case.truth.apply(centre)))
    slack = ROUNDING * case.model.diameter
    return turn <= hypothesis.farthest_turn + ROUNDING and way <= hypothesis.farthest_shift + slack


def false_reports(case: Case, possible: Booleans) -> list[str]:
    """What of all that was reported does not hold of the object where it truly is."""
    nowhere = np.flatnonzero(~possible.any(axis=1))
    if len(nowhere):
        return [f"contact {row} is on nothing within its bounds" for row in nowhere]
    return breaches(case, case.truth, possible.argmax(axis=1))


def pose_error(
    model: Polyhedron | Polygon, pose: RigidTransform, truth: RigidTransform
) -> tuple[float, float]:
    """How far a pose is from the truth, up to symmetry: radians, and metres at the centroid."""
    dimension = len(model.centroid)
    turns = np.tile(np.eye(3), (len(model.symmetries), 1, 1))
    turns[:, :dimension, :dimension] = model.symmetries
    between = pose.rotation.inv() * truth.rotation
    centroid = np.append(model.centroid, np.zeros(3 - dimension))
    shift = np.linalg.norm(pose.apply(centroid) - truth.apply(centroid))
    return float((between * Rotation.from_matrix(turns)).magnitude().min()), float(shift)


def _possible_features(case: Case, model: Polyhedron) -> Booleans:
    contacts, R = case.contacts, case.truth.rotation.as_matrix()
    points = (contacts.positions - case.truth.translation) @ R
    normals, backwards = contacts.normals @ R, -contacts.approaches @ R
    features = case.recognizer.features(model.name)
    parts = [feature_of(case, model, feature) for feature in range(len(features))]
    firsts = np.cumsum([0, *(len(triangles) for triangles, _ in parts[:-1])])
    everything = np.concatenate([triangles for triangles, _ in parts])
    apart = np.minimum.reduceat(triangle_distances(points[:, None], everything), firsts, axis=1)
    kinds = np.array([KIND_NUMBERS[features.kind(f)] for f in range(len(features))])
    possible = apart <= contacts.position_error[:, None] * (1.0 + ROUNDING)
    possible &= (contacts.kinds[:, None] == ANYTHING) | (contacts.kinds[:, None] == kinds)
    least = -np.sin(APPROACH_ERROR) - EXACT
    for row, feature in np.argwhere(possible):
        cone, bound = parts[feature][1], contacts.normal_error[row]
        faced = not contacts.approach_known[row] or float((cone @ backwards[row]).max()) >= least
        near = bound >= np.pi or cone_angles(normals[row], cone) <= bound * (1.0 + ROUNDING)
        possible[row, feature] = faced and near
    return possible


def _possible_edges(case: Case, model: Polygon) -> Booleans:
    contacts = case.contacts
    R, shift = case.truth.rotation.as_matrix()[:2, :2], case.truth.translation[:2]
    points, normals = (contacts.positions - shift) @ R, contacts.normals @ R
    apart = segment_distances(points[:, None], model.segments)
    angles = angle_between(normals[:, None], model.normals)
    reach = (contacts.position_error + model.straightness) * (1.0 + ROUNDING)
    near = angles <= contacts.normal_error[:, None] * (1.0 + ROUNDING)
    return (apart <= reach[:, None]) & (near | (contacts.normal_error >= np.pi)[:, None])
