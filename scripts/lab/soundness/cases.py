"""The soundness campaign's cases: an object touched at a known pose, and what is reported of it.

Contacts are 3 to 20, bounds are a row from (pi/15, 0.01 in) up to (pi/8, 0.1 in), poses are
uniform, and noise is uniform in its bounds or, in a third of the cases, on the very bounds.

Some searches would take minutes: of few contacts without normals, or on edges and vertices too,
there are millions of interpretations. So that a case takes well under a second typically, `KINDS`
says how few contacts each kind draws; with edges and vertices, and without any normal, all but the
last two contacts' interpretation is told, and the search goes on from there as `Recognizer.update`
does, but for a few cases from scratch. Limits on interpretations and branches cut short what would
run away; such cases are counted apart.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ....assets import STAND_IN_NAMES
from ....assets.planar import PLANAR_NAMES
from ....recognizer import FACE, Contacts, Polygon, Polyhedron, SearchLimits
from . import around as around
from .case import Case, load, recognizer
from .touch import (
    Touched,
    draw_bounds,
    leaned,
    random_pose,
    shifted,
    touch_faces,
    touch_features,
    touch_outline,
)

Floats = NDArray[np.float64]

AT_BOUNDS = 1.0 / 3.0
"""Share of the cases whose noise is on the very bounds."""
LIBRARY_FROM = 8
"""Contacts from which half of the plain cases are over the whole library: each object of it that
fewer contacts leave open takes its time, and is none of the truth's."""

UNTOLD = 2
"""Contacts at the end of which the interpretation is to be found where that of the others, three at
least, is told."""
FROM_SCRATCH = 0.05
"""Share of the cases on edges and vertices in which it isn't; their searches are cut short."""
SCRATCH = SearchLimits(budget=20, nodes=100_000)


@dataclass(frozen=True, eq=False)
class Drawing:
    """What the kinds of case start from."""

    name: str
    object_name: str
    count: int
    at_bounds: bool
    limits: SearchLimits
    rng: np.random.Generator

    def case(
        self, touched: Touched, *, mixed: bool = False, features: Literal["faces", "all"] = "faces"
    ) -> Case:
        """Touches of one object and nothing else known, with noise."""
        count, rng = len(touched.points), self.rng
        position_error, normal_error = draw_bounds(rng, count, mixed)
        contacts = Contacts(
            shifted(rng, touched.points, position_error, self.at_bounds),
            leaned(rng, touched.normals, normal_error, self.at_bounds),
            position_error=position_error,
            normal_error=normal_error,
        )
        return Case(
            self.name,
            load(self.object_name),
            recognizer((self.object_name,), features, self.limits),
            touched.T_world_object,
            touched.features,
            contacts,
        )

    @property
    def solid(self) -> Polyhedron:
        """The object, of those in space."""
        model = load(self.object_name)
        assert isinstance(model, Polyhedron)
        return model

    def on_faces(self) -> Touched:
        """Touches anywhere on the object's faces or, half of the time, where rays meet it."""
        pose = random_pose(self.rng)
        if self.rng.random() < 0.5:
            return touch_faces(self.solid, pose, self.count, self.rng)
        return around.touch_by_rays(self.solid, pose, self.count, self.rng)[0]


def _faces(drawing: Drawing) -> Case:
    case = drawing.case(drawing.on_faces())
    if drawing.count >= LIBRARY_FROM and drawing.rng.random() < 0.5:
        case = replace(case, recognizer=recognizer(STAND_IN_NAMES, "faces", drawing.limits))
    return case


def _free_space(drawing: Drawing) -> Case:
    rng, model = drawing.rng, drawing.solid
    touched, starts, ends = around.touch_by_rays(model, random_pose(rng), drawing.count, rng)
    case = drawing.case(touched)
    radii = np.zeros(len(starts))
    if rng.random() < 0.5:
        some = around.ball_paths(model, touched.T_world_object, int(rng.integers(1, 6)), rng)
        starts, ends = np.concatenate([starts, some[0]]), np.concatenate([ends, some[1]])
        radii = np.concatenate([radii, some[2]])
    error = float(case.contacts.position_error[0])
    paths = around.free_space(rng, starts, ends, radii, error, drawing.at_bounds)
    return replace(case, free_space=paths)


def _support(drawing: Drawing) -> Case:
    rng, model = drawing.rng, drawing.solid
    error = float(draw_bounds(rng, 1, False)[0][0])
    if rng.random() < 0.5:
        touched = drawing.on_faces()
        pose = touched.T_world_object
        plane = around.above_plane(model, pose, error, rng, drawing.at_bounds)
    else:
        pose, plane = around.resting(model, error, rng, drawing.at_bounds)
        touched = touch_faces(model, pose, drawing.count, rng)
    return replace(drawing.case(touched), support=plane)


def _approaches(drawing: Drawing) -> Case:
    touched = drawing.on_faces()
    case = drawing.case(touched)
    ways = around.approaches(touched, drawing.rng, drawing.at_bounds)
    # Of a third of the contacts, in half of the cases, the way there is all that is felt.
    some = drawing.rng.random(drawing.count) < drawing.rng.choice([0.0, 0.3])
    return replace(case, contacts=_relabelled(case.contacts, some, ways))


def _outliers(drawing: Drawing) -> Case:
    rng = drawing.rng
    case = drawing.case(drawing.on_faces())
    spare = 1 if drawing.count < 10 else int(rng.integers(1, 3))
    rows = rng.permutation(drawing.count)[:spare]
    positions, normals = case.contacts.positions.copy(), case.contacts.normals.copy()
    centre = case.truth.apply(drawing.solid.centroid)
    positions[rows] = centre + rng.uniform(-0.6, 0.6, (spare, 3)) * drawing.solid.diameter
    normals[rows] = Rotation.random(spare, rng=rng).apply([0.0, 0.0, 1.0])
    interpretation = case.interpretation.copy()
    interpretation[rows] = -1
    contacts = Contacts(
        positions,
        normals,
        position_error=case.contacts.position_error,
        normal_error=case.contacts.normal_error,
    )
    return replace(case, contacts=contacts, interpretation=interpretation, outliers=spare)


def _edges(drawing: Drawing) -> Case:
    features = recognizer((drawing.object_name,), "all", drawing.limits).features
    scratch = drawing.rng.random() < FROM_SCRATCH
    sharp = int(drawing.rng.integers(1, drawing.count + 1))
    touched = touch_features(
        drawing.solid,
        features(drawing.object_name),
        random_pose(drawing.rng),
        drawing.count,
        sharp,
        drawing.rng,
    )
    if scratch:
        return replace(drawing, limits=SCRATCH).case(touched, features="all")
    case = drawing.case(touched, features="all")
    return replace(case, told=max(3, drawing.count - UNTOLD))


def _known_kinds(drawing: Drawing) -> Case:
    features = recognizer((drawing.object_name,), "all", drawing.limits).features(
        drawing.object_name
    )
    rng = drawing.rng
    sharp = int(rng.integers(1, 2 + drawing.count // 2))
    pose = random_pose(rng)
    touched = touch_features(drawing.solid, features, pose, drawing.count, sharp, rng)
    case = drawing.case(touched, features="all")
    on_edge = touched.features >= features.face_count
    on_vertex = touched.features >= features.face_count + features.edge_count
    contacts = Contacts(
        case.contacts.positions,
        case.contacts.normals,
        position_error=case.contacts.position_error,
        normal_error=case.contacts.normal_error,
        kinds=FACE + on_edge.astype(int) + on_vertex,
    )
    return replace(case, contacts=contacts)


def _some_normals(drawing: Drawing) -> Case:
    case = drawing.case(drawing.on_faces())
    rng, count = drawing.rng, drawing.count
    unknown = rng.permutation(count)[: int(rng.integers(1, 1 + count // 3))]
    return replace(case, contacts=_relabelled(case.contacts, np.isin(np.arange(count), unknown)))


def _no_normals(drawing: Drawing) -> Case:
    case = drawing.case(drawing.on_faces())
    unknown = np.ones(drawing.count, bool)
    return replace(
        case, contacts=_relabelled(case.contacts, unknown), told=max(3, drawing.count - UNTOLD)
    )


def _mixed(drawing: Drawing) -> Case:
    return drawing.case(drawing.on_faces(), mixed=True)


def _planar(drawing: Drawing) -> Case:
    rng, model = drawing.rng, load(drawing.object_name)
    assert isinstance(model, Polygon)
    turn = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi))
    pose = RigidTransform.from_components(np.append(rng.uniform(-0.5, 0.5, 2), 0.0), turn)
    touched = touch_outline(model, pose, drawing.count, rng)
    case = drawing.case(touched, mixed=rng.random() < 0.2)
    unknown = rng.random(drawing.count) < rng.choice([0.0, 0.0, 0.3])
    return replace(case, contacts=_relabelled(case.contacts, unknown))


def _relabelled(
    contacts: Contacts, unknown: NDArray[np.bool_], ways: Floats | None = None
) -> Contacts:
    """The same contacts with some normals unknown and, if given, how they were approached."""
    return Contacts(
        contacts.positions,
        np.where(unknown[:, None], np.nan, contacts.normals),
        position_error=contacts.position_error,
        normal_error=contacts.normal_error,
        approaches=ways,
    )


@dataclass(frozen=True)
class Kind:
    """One kind of case."""

    share: float
    """Of all cases."""
    what: str
    draw: Callable[[Drawing], Case]
    contacts: tuple[int, int] = (3, 20)
    """The fewest and the most."""
    objects: tuple[str, ...] = STAND_IN_NAMES
    budget: int = 2_000
    """The most interpretations of one object."""
    nodes: int = 500_000
    """The most branches of one object's tree."""


KINDS: dict[str, Kind] = {
    "faces": Kind(0.16, "contacts on faces, nothing else known", _faces),
    "mixed": Kind(0.10, "bounds of its own for each contact", _mixed),
    "planar": Kind(0.18, "outlines of the plane", _planar, objects=PLANAR_NAMES),
    "free": Kind(0.12, "paths of rays and of balls, misses too", _free_space, (5, 20)),
    "support": Kind(0.10, "above a plane, or resting on it", _support, (4, 20)),
    "approaches": Kind(
        0.08, "ways from which contacts were approached", _approaches, (7, 20), budget=500
    ),
    "outliers": Kind(0.08, "one or two contacts on nothing", _outliers, (7, 20)),
    "edges": Kind(0.04, "some or all contacts on edges and vertices", _edges, (4, 20), budget=50),
    "some-normals": Kind(0.06, "some normals unknown", _some_normals, (7, 20)),
    "no-normals": Kind(0.02, "no normal known", _no_normals, (4, 12), budget=300),
    "known-kinds": Kind(
        0.06, "contacts known to be on faces, edges or vertices", _known_kinds, (4, 20), budget=500
    ),
}
"""Every kind; the shares add up to one."""


def draw_case(kind: str, seed: int, index: int) -> Case:
    """The case of a campaign's seed, the same wherever and whenever it is drawn."""
    spec = KINDS[kind]
    stream = np.random.SeedSequence(seed, spawn_key=(index, list(KINDS).index(kind)))
    rng = np.random.default_rng(stream)
    drawing = Drawing(
        name=f"{kind}:{index}",
        object_name=spec.objects[int(rng.integers(len(spec.objects)))],
        count=int(rng.integers(spec.contacts[0], spec.contacts[1] + 1)),
        at_bounds=bool(rng.random() < AT_BOUNDS),
        limits=SearchLimits(budget=spec.budget, nodes=spec.nodes),
        rng=rng,
    )
    return spec.draw(drawing)


def draw_kind(seed: int, index: int, kinds: tuple[str, ...]) -> str:
    """The kind of a campaign's case, by the kinds' shares."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    shares = np.array([KINDS[kind].share for kind in kinds])
    return kinds[int(rng.choice(len(kinds), p=shares / shares.sum()))]
