"""The soundness campaign's judge: is the truth held, and does a pose meet every bound?

Plain numpy on triangles, see `oracles.geometry`: nothing of the recogniser's own geometry.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from oracles.geometry import (
    COPLANAR,
    angle_between,
    cone_angles,
    footings,
    nearest_on_paths,
    segment_distances,
    triangle_distances,
)
from scipy.spatial.transform import RigidTransform

from ....recognizer import Belief, FreeSpace, Polygon, Polyhedron, SupportPlane
from ....recognizer.contacts.contacts import APPROACH_ERROR
from .case import Case
from .touch import cone_of, hull_of

Floats = NDArray[np.float64]
Row = NDArray[np.integer]

ROUNDING = 1e-6
"""Share of a bound by which a pose may miss it."""
EXACT = 1e-8
"""The same in sines and in shares of the diameter, where there is no bound to take a share of."""
GRAIN = 0.1
"""Share of a path's error to which its way past an object is looked at."""


@dataclass(frozen=True)
class Outcome:
    """How one case went."""

    name: str
    """``KIND:INDEX``."""
    object_name: str
    contacts: int
    held: bool
    """The true interpretation, up to symmetry, is one of some hypothesis."""
    complete: bool
    """The search of the true object ran to its end."""
    hypotheses: int
    undecided: int
    """Hypotheses that are not proven."""
    bad: tuple[str, ...]
    """Proven hypotheses whose pose breaks a bound, and which; one of the truth itself would be an
    error of the campaign."""
    milliseconds: float
    """That the recogniser took."""

    @property
    def kind(self) -> str:
        """What kind of case it was."""
        return self.name.partition(":")[0]

    @property
    def lost(self) -> bool:
        """Whether the truth is missing where nothing excuses it."""
        return self.complete and not self.held


def judge(case: Case) -> Outcome:
    """Recognise a case and hold the belief against the truth."""
    bad = [f"the truth {what}" for what in breaches(case, case.truth, case.interpretation)]
    started = perf_counter()
    belief = case.recognize()
    milliseconds = 1e3 * (perf_counter() - started)
    for number, hypothesis in enumerate(belief.hypotheses):
        if hypothesis.proven:
            row, pose = hypothesis.interpretations[0], hypothesis.pose
            model = model_of(case, hypothesis.object_name)
            broken = breaches(case, pose, row, model)
            bad += [f"hypothesis {number} ({hypothesis.object_name}) {what}" for what in broken]
    name = case.model.name
    (complete,) = [s.complete for s in belief.searches if s.object_name == name]
    return Outcome(
        name=case.name,
        object_name=name,
        contacts=len(case.contacts),
        held=holds_truth(case, belief),
        complete=complete,
        hypotheses=len(belief.hypotheses),
        undecided=sum(not hypothesis.proven for hypothesis in belief.hypotheses),
        bad=tuple(bad),
        milliseconds=milliseconds,
    )


def raised(case: Case, error: Exception) -> Outcome:
    """The outcome of a case that could not be judged."""
    what = f"raised {type(error).__name__}: {error}"
    return Outcome(case.name, case.model.name, len(case.contacts), False, True, 0, 0, (what,), 0.0)


def model_of(case: Case, name: str) -> Polyhedron | Polygon:
    """The model of a case's library that has a name."""
    (model,) = [
        model
        for model in (*case.recognizer.models, *case.recognizer.outlines)
        if model.name == name
    ]
    return model


def holds_truth(case: Case, belief: Belief) -> bool:
    """Whether a hypothesis of the right object has the truth, or a symmetric copy of it."""
    images = np.column_stack([symmetric_images(case), np.full(len(case.model.symmetries), -1)])
    # A row of -1 ends each, so that an outlier stays one.
    wanted = images[:, case.interpretation]
    return any(
        bool((hypothesis.interpretations == row).all(axis=1).any())
        for hypothesis in belief.hypotheses
        if hypothesis.object_name == case.model.name
        for row in wanted
    )


def symmetric_images(case: Case) -> NDArray[np.intp]:
    """(g, f) the feature that each symmetry of a case's object takes each feature to."""
    model = case.model
    if isinstance(model, Polygon):
        middles, normals = model.segments.mean(axis=1), model.normals
    else:
        features = case.recognizer.features(model.name)
        middles, normals = features.middles, features.normals
    places = np.column_stack([middles - model.centroid, model.diameter * normals])
    dimension = middles.shape[1]
    images = []
    for turn in model.symmetries:
        moved = np.hstack([places[:, :dimension] @ turn.T, places[:, dimension:] @ turn.T])
        images.append(np.linalg.norm(moved[:, None] - places, axis=2).argmin(axis=1))
    return np.array(images)


def breaches(
    case: Case, pose: RigidTransform, row: Row, model: Polyhedron | Polygon | None = None
) -> list[str]:
    """Which of a case's bounds a pose breaks, if the contacts are on the features of a row.

    Args:
        case: what was felt, and what else is known.
        pose: model to world.
        row: (n,) a feature for each contact, -1 for none.
        model: the object that is at the pose; by default the true one.
    """
    model = model or case.model
    if len(row) != len(case.contacts) or int((row < 0).sum()) > case.outliers:
        return ["has an interpretation that is none"]
    if isinstance(model, Polygon):
        return _contact_breaches_in_plane(case, pose, row, model)
    broken = _contact_breaches(case, pose, row, model)
    broken += _approach_breaches(case, pose, row, model)
    if case.support is not None:
        broken += _support_breaches(model, pose, case.support)
    if case.free_space is not None and not broken:
        broken += _path_breaches(model, pose, case.free_space)
    return broken


def _contact_breaches(case: Case, pose: RigidTransform, row: Row, model: Polyhedron) -> list[str]:
    contacts, broken = case.contacts, []
    R = pose.rotation.as_matrix()
    points, normals = (contacts.positions - pose.translation) @ R, contacts.normals @ R
    for i, f in enumerate(map(int, row)):
        if f < 0:
            continue
        corners, cone = feature_of(case, model, f)
        distance = float(triangle_distances(points[i], corners).min())
        if distance > contacts.position_error[i] * (1.0 + ROUNDING):
            broken.append(f"has contact {i} {distance:.9g} m from feature {f}")
        unknown = contacts.normal_error[i] >= np.pi
        angle = 0.0 if unknown else float(cone_angles(normals[i], cone))
        if angle > contacts.normal_error[i] * (1.0 + ROUNDING):
            broken.append(f"has normal {i} {angle:.9g} rad from feature {f}")
    return broken


def feature_of(case: Case, model: Polyhedron, feature: int) -> tuple[Floats, Floats]:
    """(t, 3, 3) triangles of a feature, flat of an edge or vertex, and (k, 3) its normals."""
    if feature < model.face_count:
        triangles = model.triangles[model.triangle_faces == feature]
        return model.vertices[triangles], model.normals[[feature]]
    features = case.recognizer.features(model.name)
    return hull_of(features, feature)[[0, -1, -1]][None], cone_of(features, feature)


def _contact_breaches_in_plane(
    case: Case, pose: RigidTransform, row: Row, model: Polygon
) -> list[str]:
    contacts = case.contacts
    R, t = pose.rotation.as_matrix(), pose.translation
    broken = []
    if abs(R[2, 2] - 1.0) > EXACT or abs(t[2]) > EXACT * model.diameter:
        broken.append("leaves the plane")
    points, normals = (contacts.positions - t[:2]) @ R[:2, :2], contacts.normals @ R[:2, :2]
    distances = segment_distances(points, model.segments[row])
    angles = angle_between(normals, model.normals[row])
    angles[contacts.normal_error >= np.pi] = 0.0
    reach = (contacts.position_error + model.straightness) * (1.0 + ROUNDING)
    for i in np.flatnonzero(distances > reach):
        broken.append(f"has contact {i} {distances[i]:.9g} m from edge {row[i]}")
    for i in np.flatnonzero(angles > contacts.normal_error * (1.0 + ROUNDING)):
        broken.append(f"has normal {i} {angles[i]:.9g} rad from edge {row[i]}")
    return broken


def _approach_breaches(case: Case, pose: RigidTransform, row: Row, model: Polyhedron) -> list[str]:
    broken = []
    for i in np.flatnonzero(case.contacts.approach_known & (row >= 0)):
        # If no corner of a cone faces the finger, nothing between them does.
        normals = pose.rotation.apply(feature_of(case, model, int(row[i]))[1])
        facing = float((normals @ -case.contacts.approaches[i]).max())
        if facing < -np.sin(APPROACH_ERROR) - EXACT:
            broken.append(f"shows approach {i} feature {row[i]} from behind, by {facing:.9g}")
    return broken


def _support_breaches(model: Polyhedron, pose: RigidTransform, support: SupportPlane) -> list[str]:
    slack = ROUNDING * support.error + EXACT * model.diameter
    heights = pose.apply(model.vertices) @ support.up - support.height
    broken = []
    if heights.min() < -support.error - slack:
        broken.append(f"is {-heights.min():.9g} m below its support")
    if support.resting:
        faces = footings(model, 2.0 * COPLANAR * model.diameter)
        off = [np.abs(pose.apply(f.corners) @ support.up - support.height).max() for f in faces]
        if min(off) > support.error + slack:
            broken.append(f"stands on nothing: {min(off):.9g} m off")
    return broken


def _path_breaches(model: Polyhedron, pose: RigidTransform, paths: FreeSpace) -> list[str]:
    clearances = paths.radius - paths.error
    back = pose.inv()
    nearest = nearest_on_paths(
        model,
        back.apply(paths.starts.copy()),
        back.apply(paths.ends.copy()),
        clearances,
        GRAIN * paths.error,
    )
    near = nearest < clearances - ROUNDING * paths.error - EXACT * model.diameter
    return [
        f"is {nearest[i]:.9g} m from path {i}, which keeps {clearances[i]:.9g} m"
        for i in np.flatnonzero(near)
    ]
