"""What probes would tell about a belief: each pose's report, held against every other pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...recognizer import Polyhedron
from ...recognizer.models.polyhedron import FacePolygons
from ...recognizer.predict.prediction import MET_OBJECT, PoseSamples, Predictions, predict
from ...recognizer.predict.probes import TriadRays
from .explanation_kernels import likelihoods_explained
from .outcome_kernels import likelihoods_left, report_distances
from .rivals import same_answer
from .task import Task

Floats = NDArray[np.float64]

UNFELT = 1e6
"""A width of the cone of normals beside which any two of them are as good as one."""
STEPS = 256
"""Of the table of how much two cones overlap: good to 1e-3."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What each of ``a`` probes would report if each of ``s`` poses were true."""

    task: Task
    samples: PoseSamples
    actions: Floats
    """(a, 3) the probes, each number in [-1, 1]."""
    rays: TriadRays
    """Theirs."""
    predictions: Predictions
    same: NDArray[np.bool_]
    """(s, s) pairs that the goal need not have told apart."""
    chances: Floats
    """(s,) how likely each pose is the true one; they sum to 1. `weights` say how much it matters
    that a pose is ruled out, which a rival may have to be that is hardly true."""
    thorough: bool = False
    """Whether a touch may be explained by any face of a pose, as the recogniser has it, or only by
    the one that the same ray meets, which is quicker."""

    @classmethod
    def of(
        cls, task: Task, samples: PoseSamples, actions: Floats, chances: Floats | None = None
    ) -> Outcomes:
        """Predict the reports of probes; without ``chances`` they are the weights."""
        rays = task.space.rays(actions)
        told = predict(samples, rays, radius=task.radius)
        return cls.of_predictions(task, samples, actions, rays, told, chances)

    @classmethod
    def of_predictions(
        cls,
        task: Task,
        samples: PoseSamples,
        actions: Floats,
        rays: TriadRays,
        predictions: Predictions,
        chances: Floats | None = None,
    ) -> Outcomes:
        """Of probes whose reports are predicted; without ``chances`` they are the weights."""
        chances = samples.weights if chances is None else chances
        return cls(task, samples, actions, rays, predictions, same_answer(task, samples), chances)

    def thoroughly(self, rows: NDArray[np.int64]) -> Outcomes:
        """Some of the probes, looked at thoroughly."""
        told = self.predictions
        return replace(
            self,
            actions=self.actions[rows],
            rays=TriadRays(self.rays.starts_world[rows], self.rays.directions_world[rows]),
            predictions=Predictions(
                told.outcomes[:, rows],
                told.depths[:, rows],
                told.normals_world[:, rows],
                told.depth_spread[:, rows],
            ),
            thorough=True,
        )

    @property
    def weights(self) -> Floats:
        """(s,) how much each pose counts as a rival; they sum to 1."""
        return self.samples.weights

    @cached_property
    def kept(self) -> Floats:
        """(a, s) the weight of rivals that a report leaves standing if each pose is true.

        Sums here and in `expected` don't go through BLAS, whose order of adding depends on how many
        threads it has: the same stream has to give the same probe.
        """
        return np.einsum("aij,j->ai", self.left, self.weights)

    def expected(self, values: NDArray[np.floating]) -> Floats:
        """(a,) the mean of what would be, (a, s), if each pose were true, by their chances."""
        return np.einsum("ai,i->a", values, self.chances)

    @cached_property
    def left(self) -> NDArray[np.float32]:
        """How likely each pose is to be left standing by the report if another is true.

        Noise is uniform in a ball and a cone. A point felt is then off its face by a distance ``x``
        of density ``1 - x^2`` within the bound, and a normal is likely to be within the cone of
        another by how much the two cones, as discs, overlap. A pose stands if it explains what was
        felt by all rays. Bounds are widened by the poses' own spread.

        Returns:
            (a, s, s): row the true pose, column the one that stands; 1 for pairs with the same
            answer.
        """
        out = np.empty((len(self.actions), len(self.samples), len(self.samples)), np.float32)
        arguments: list[Any] = [*self._compared(), _overlaps(), out]
        likelihoods_left(*arguments)
        if self.thorough:
            self._explain(out)
        return out

    @cached_property
    def distances(self) -> NDArray[np.float32]:
        """How far the reports of two poses differ, in twice the bounds on what is felt.

        The larger of the difference in depth, across the face, over twice the bound on positions
        and of the angle between the normals (its chord) over twice the bound on normals, of the
        ray that tells most; infinite between touch and miss. Bounds are widened by the poses' own
        spread. Above 1 no report fits both; if `thorough`, no more than the share of reports that
        no face of the second pose explains, where one does explain some.

        Returns:
            (a, s, s): row the true pose; 0 for pairs with the same answer.
        """
        out = np.empty((len(self.actions), len(self.samples), len(self.samples)), np.float32)
        arguments: list[Any] = [*self._compared(), out]
        report_distances(*arguments)
        if self.thorough:
            np.minimum(out, np.where(self.left > 0.0, 1.0 - self.left, np.inf), out=out)
        return out

    def _explain(self, out: NDArray[np.float32]) -> None:
        samples, told = self.samples, self.predictions
        turns = Rotation.from_quat(samples.rotations)
        models = samples.models
        ends = np.cumsum([0, *(model.face_count for model in models)])
        centroids = np.array([model.centroid for model in models])[samples.objects]
        points = self.rays.starts_world + told.depths[..., None] * self.rays.directions_world
        points = points - self.task.radius * told.normals_world  # depths are of a ball's centre
        likelihoods_explained(
            self._compared(),
            _overlaps(),
            np.ascontiguousarray(np.moveaxis(points, 0, 2)),
            (
                ends[samples.objects],
                ends[samples.objects + 1],
                turns.as_matrix(),
                samples.positions,
                turns.apply(centroids) + samples.positions,
            ),
            (samples.position_spread, samples.rotation_spread),
            _joined([model.pieces for model in models], models),
            (np.empty(3), np.empty(ends[-1], np.int64), *np.empty((2, ends[-1]))),
            out,
        )

    def _compared(self) -> tuple[Any, ...]:
        """What the kernels hold against each other, probe by probe, in single precision."""
        told = self.predictions
        bits = (told.outcomes == MET_OBJECT) << np.arange(told.outcomes.shape[2])
        slopes = np.abs(np.einsum("sakx,akx->sak", told.normals_world, self.rays.directions_world))
        turns = self.samples.rotation_spread**2
        cones = self.task.normal_error + np.sqrt(turns[:, None] + turns)
        # Twice a cone is at most all directions there are; of normals that aren't felt, none
        # is told from another.
        widths = 2.0 * np.sin(np.minimum(cones, 0.5 * np.pi))
        if self.task.normal_error >= np.pi:
            widths[:] = UNFELT
        return (
            np.ascontiguousarray(bits.sum(axis=2).T, np.uint8),
            _by_probe(told.depths),
            _by_probe(slopes),
            _by_probe(told.depth_spread),
            _by_probe(told.normals_world),
            self.same,
            np.float32(self.task.position_error),
            widths.astype(np.float32),
            self.task.free_space,
        )


def _joined(
    pieces: Sequence[FacePolygons], models: Sequence[Polyhedron]
) -> tuple[NDArray[np.generic], ...]:
    """The faces of all models, one after the other, as the kernels read them."""
    polygons = np.cumsum([0, *(len(piece.start) - 1 for piece in pieces)])
    corners = np.cumsum([0, *(len(piece.corners) for piece in pieces)])
    first = [piece.first[:-1] + many for piece, many in zip(pieces, polygons, strict=False)]
    start = [piece.start[:-1] + many for piece, many in zip(pieces, corners, strict=False)]
    normals = np.concatenate([model.normals for model in models])
    offsets = np.concatenate([model.offsets for model in models])
    balls = np.concatenate([piece.balls for piece in pieces])
    return (
        normals,
        offsets,
        np.append(np.concatenate(first), polygons[-1]),
        np.append(np.concatenate(start), corners[-1]),
        np.concatenate([piece.corners for piece in pieces]),
        np.ascontiguousarray(np.column_stack([normals, offsets, balls]).T),
    )


def _by_probe(values: Floats) -> NDArray[np.float32]:
    """(s, a, k, ...) as (a, k, s, ...)."""
    return np.ascontiguousarray(np.moveaxis(values, 0, 2), np.float32)


def _overlaps() -> NDArray[np.float32]:
    """(STEPS + 2,) the share of a disc that another as large covers, by how far apart they are.

    The distance goes from 0 to two radii in equal steps; then comes a zero for what is just there.
    """
    far = np.linspace(0.0, 1.0, STEPS + 1)
    shares = 1.0 - 2.0 / np.pi * (np.arcsin(far) + far * np.sqrt(1.0 - far**2))
    return np.append(np.maximum(shares, 0.0), 0.0).astype(np.float32)
