"""How many interpretations to expect: the combinatorics of distance pruning (memo, Section 6).

The memo's propositions as functions, with what is wrong in their text said beside each. They are
estimates and not bounds: all rest on sensed distances that are uniform over the diameter, each
independent of the one before, and those of touches are neither. None looks at more than the
distance to the contact before, so all pairs together prune far more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....recognizer.models.polyhedron import Polyhedron
from ....recognizer.tables.planar_ranges import PlanarTables
from ....recognizer.tables.ranges import PairTables

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Measures:
    """What the propositions want to know of a polyhedron."""

    face_count: int
    diameter: float
    """Largest distance between two of its points, metres."""
    surface_area: float
    """Square metres."""
    face_diameter: float
    """Largest distance between two points of one face, metres."""
    sensitivity: float
    """See `distance_sensitivity`, metres."""

    @property
    def stretch(self) -> float:
        """`sensitivity` over the diameter of a disc of a face's mean area.

        At least 1; without sensing error 1.25 for squares and 1.35 or more for triangles.
        """
        return self.sensitivity / _disc_diameter(self.surface_area / self.face_count)


def measure(model: Polyhedron, tables: PairTables, *, position_error: float = 0.0) -> Measures:
    """What the propositions want to know of a model.

    Args:
        model: the object.
        tables: its range tables.
        position_error: bound on the position of a contact, metres.

    Raises:
        ValueError: a negative error, or tables of another model.
    """
    middles = face_middles(model)
    return Measures(
        face_count=model.face_count,
        diameter=model.diameter,
        surface_area=float(model.areas.sum()),
        face_diameter=float(tables.distance_max.diagonal().max()),
        sensitivity=distance_sensitivity(tables, middles, position_error=position_error),
    )


def face_middles(model: Polyhedron) -> Floats:
    """(f, 3) the centroid of each face, object frame, metres."""
    triangles = model.vertices[model.triangles]
    sides = triangles[:, 1:] - triangles[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    sums = np.zeros((model.face_count, 3))
    np.add.at(sums, model.triangle_faces, areas[:, None] * triangles.mean(axis=1))
    totals = np.bincount(model.triangle_faces, weights=areas, minlength=model.face_count)
    return sums / totals[:, None]


def distance_sensitivity(
    tables: PairTables | PlanarTables, middles: Floats, *, position_error: float = 0.0
) -> float:
    """How far a sensed distance can be from the distance of two faces' middles (Section 6.1).

    The memo defines it as the supremum of all widths that hold every distance of two faces, and
    means the least. A face goes with itself too, so it is never below a face's diameter.

    Args:
        tables: range tables, of a polyhedron or of an outline.
        middles: (f, d) a point for each face or edge, metres.
        position_error: bound on the position of a contact, metres; both ends are off by it.

    Returns:
        The largest over all pairs, metres.

    Raises:
        ValueError: a negative error, or not one middle a face.
    """
    _not_negative(position_error=position_error)
    if len(middles) != tables.face_count:
        raise ValueError(f"{len(middles)} middles for {tables.face_count} faces: one each")
    between = np.linalg.norm(middles[:, None] - middles, axis=2)
    beyond = np.maximum(tables.distance_max - between, between - tables.distance_min)
    return float(beyond.max()) + 2.0 * position_error


def expected_nodes(
    level: int, face_count: int, sensitivity: float, object_diameter: float
) -> float:
    """Interpretations at a level of the tree if each distance prunes by itself (Proposition 1).

    ``n (2 e n / d)^(k - 1)``, an upper bound on the number expected, says the memo. It is one for
    distances that are uniform on [0, d] and independent. Then the branches of each node can be
    averaged by themselves, and no more than 2 e of all d fit a face. But:

    - "Best given by a uniform distribution" is an assumption. On a sphere of small faces both
      touches and faces lie at large distances: up to a third more faces are within e.
    - Distances of touches in a row share an end; a product of means is not the mean of a product.
    - The proof has the most branches of any face inside the mean, then outside. Outside is enough,
      if distances are independent; inside is more than that. Its window, from s - e to s + e, is
      shifted by s once more under the integral.
    - Where e is above d / 2 it exceeds n^k, and says nothing. So it is for a cube.

    Args:
        level: k, 1 for the first contact.
        face_count: n.
        sensitivity: e, see `distance_sensitivity`; with the error of a sensed distance in it.
        object_diameter: d, in the unit of the sensitivity.

    Raises:
        ValueError: a level or a count below 1, a negative sensitivity, no diameter.
    """
    _at_least_one(level=level, face_count=face_count)
    _not_negative(sensitivity=sensitivity)
    _positive(object_diameter)
    return face_count * (2.0 * sensitivity * face_count / object_diameter) ** (level - 1)


def edge_sensitivity(edge_length: float, *, distance_error: float = 0.0) -> float:
    """The distance sensitivity of an outline of equal edges, metres (Proposition 2).

    An edge's points are within half its length of its middle, so two points are nearer or farther
    than two middles by a whole length at most. That is right, and reached: by an edge with itself.
    Where edges differ, the longest counts.

    Args:
        edge_length: metres.
        distance_error: bound on the error of a sensed distance, metres.

    Raises:
        ValueError: a negative length.
    """
    _not_negative(edge_length=edge_length, distance_error=distance_error)
    return edge_length + distance_error


def expected_nodes_of_outline(
    level: int, edge_count: int, perimeter: float, object_diameter: float
) -> float:
    """Interpretations at a level for an outline of equal edges (corollary of Proposition 2).

    ``n (2 p / d)^(k - 1)``, linear in n, since n edges of length e make the perimeter p. It leaves
    out the error of the sensed distance: with it p is larger by n times that. An outline is at
    least twice as long as its diameter, so the base is never below 4; a convex one is at most pi
    times as long, which makes it 2 pi.

    Args:
        level: k, 1 for the first contact.
        edge_count: n.
        perimeter: p, metres.
        object_diameter: d, metres.

    Raises:
        ValueError: a level or a count below 1, a negative perimeter, no diameter.
    """
    _at_least_one(level=level, edge_count=edge_count)
    _not_negative(perimeter=perimeter)
    _positive(object_diameter)
    return edge_count * (2.0 * perimeter / object_diameter) ** (level - 1)


def face_sensitivity_as_printed(face_diameter: float, *, distance_error: float = 0.0) -> float:
    """The distance sensitivity of faces of equal diameter as the memo has it (Proposition 3).

    Its proof puts each face in a ball of its own diameter around its middle. A face that is its
    own image in its middle fits; an equilateral triangle of side 1 reaches 0.577 from its middle,
    not 0.5. A regular icosahedron's sensitivity is 1.079 times this. See `face_sensitivity`.

    Args:
        face_diameter: metres.
        distance_error: bound on the error of a sensed distance, metres.

    Raises:
        ValueError: a negative length.
    """
    return edge_sensitivity(face_diameter, distance_error=distance_error)


def face_sensitivity(face_diameter: float, *, distance_error: float = 0.0) -> float:
    """A bound on the distance sensitivity of convex faces of a diameter, metres.

    No point of a convex figure of diameter e is farther than 2 e / 3 from its centroid: on the line
    through both, the centroid cuts off a third at least (Minkowski). So it is 4/3 of what the memo
    prints. Arguments and errors are those of `face_sensitivity_as_printed`.
    """
    _not_negative(face_diameter=face_diameter, distance_error=distance_error)
    return 4.0 / 3.0 * face_diameter + distance_error


def expected_nodes_of_equal_faces_as_printed(
    level: int, face_count: int, surface_area: float, object_diameter: float
) -> float:
    """Interpretations at a level for equal faces, as printed (corollary of Proposition 3).

    ``(4 sqrt(A / (pi d^2)))^(k - 1) n^((k - 1) / 2)``. Not a bound:

    - The exponent of n should be (k + 1) / 2, as the memo's own Section 6.2 has it: with
      e = 2 sqrt(A / (pi n)) Proposition 1 is (4 sqrt(A / (pi d^2)) sqrt(n))^(k - 1) n. As printed
      it is 1 and not n for one contact.
    - It rests on A_f >= pi (e / 2)^2 for a face of area A_f and diameter e: the isodiametric
      inequality the wrong way round, for only a disc has that much. A square's e is 1.25 times
      what follows from its area; a needle's can be any number of times.
    - It rests on Proposition 3, see `face_sensitivity_as_printed`.

    Arguments and errors are those of `expected_nodes_of_equal_faces`.
    """
    right = expected_nodes_of_equal_faces(level, face_count, surface_area, object_diameter)
    return right / face_count


def expected_nodes_of_equal_faces(
    level: int,
    face_count: int,
    surface_area: float,
    object_diameter: float,
    *,
    stretch: float = 1.0,
) -> float:
    """Interpretations at a level for faces of equal area; Proposition 1 in terms of the surface.

    ``(4 c sqrt(A / (pi d^2)))^(k - 1) n^((k + 1) / 2)``: the exponent put right, and a factor c for
    what discs have and faces haven't. At the least stretch, 1, it is no bound either.

    Args:
        level: k, 1 for the first contact.
        face_count: n.
        surface_area: A, square metres.
        object_diameter: d, metres.
        stretch: c, the sensitivity over the diameter of a disc of a face's area, see
            `Measures.stretch`.

    Raises:
        ValueError: a level or a count below 1, a negative area, no diameter, a stretch below 1.
    """
    _not_negative(surface_area=surface_area)
    _at_least_one(face_count=face_count)
    if not stretch >= 1.0:
        raise ValueError(f"stretch is {stretch:g}; no face is rounder than a disc, which has 1")
    sensitivity = stretch * _disc_diameter(surface_area / face_count)
    return expected_nodes(level, face_count, sensitivity, object_diameter)


def expected_nodes_of_convex_as_printed(level: int, face_count: int) -> float:
    """The same for convex objects, as printed: ``4^(k - 1) n^((k - 1) / 2)``.

    That a convex object has A <= pi d^2 is right: A is four times the mean area of its shadows
    (Cauchy), each of diameter d at most. What is wrong is what it is put into, see
    `expected_nodes_of_equal_faces_as_printed`.

    Arguments and errors are those of `expected_nodes_of_equal_faces`.
    """
    return expected_nodes_of_equal_faces_as_printed(level, face_count, math.pi, 1.0)


def expected_nodes_of_convex(level: int, face_count: int, *, stretch: float = 1.0) -> float:
    """The same for convex objects, put right: ``(4 c)^(k - 1) n^((k + 1) / 2)``.

    Arguments and errors are those of `expected_nodes_of_equal_faces`.
    """
    return expected_nodes_of_equal_faces(level, face_count, math.pi, 1.0, stretch=stretch)


def _disc_diameter(area: float) -> float:
    return 2.0 * math.sqrt(area / math.pi)


def _at_least_one(**values: int) -> None:
    for name, value in values.items():
        if value < 1:
            raise ValueError(f"{name} is {value}; it must be at least 1")


def _not_negative(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value >= 0.0):
            raise ValueError(f"{name} is {value:g}; it must be finite and not negative")


def _positive(value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"object_diameter is {value:g}; it must be finite and above zero")
