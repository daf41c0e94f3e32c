"""A guarded move: the tip is driven along a ray until it feels something, and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...recognizer import FACE
from ..scene.finger import Finger, TipContact
from ..scene.scene import NOTHING, OBJECT, PLANE, ProbeScene
from .ball_sweep import BallSweep
from .ball_touch import BallFelt, kind_of

Floats = NDArray[np.float64]

TRAVEL_SHARE = 1.0 / 400.0
"""How far the tip goes in a time step, at most, as a share of its radius. Nothing is thin enough to
be passed by in between: a tip that is not touching at either end of a step has met at most a sliver
of a millionth of its radius."""
LONGEST_STEP = 5e-4
"""Seconds; contacts and control take ten times as long and more."""
RUN_UP = 100
"""Steps before the first contact from which the way is simulated."""
CLEAR = 20
"""Steps without a contact after which the tip counts as free."""
MOST_RETREAT = 0.5
"""Seconds in which a tip gets free of what it touches; one that is hooked is then let go."""
ON_ITS_WAY = 1e-7
"""A tip is back on its ray when it is this near to it, metres."""


class GuardedMove:
    """One move of a mounted finger."""

    def __init__(
        self,
        scene: ProbeScene,
        sweep: BallSweep,
        start: Floats,
        direction: Floats,
        speed: float,
        force_threshold: float | None,
    ) -> None:
        """Prepare a move.

        Args:
            scene: with the finger in it.
            sweep: of a ball like the tip.
            start: (3,) where the tip's centre starts, world frame, metres.
            direction: (3,) unit direction.
            speed: metres a second.
            force_threshold: newtons; None to stop at first contact.
        """
        design = scene.finger
        if design is None:
            raise ValueError("the scene has no finger: mount one")
        self._scene, self._sweep = scene, sweep
        self._start, self._direction = start, direction
        self._speed, self._threshold = speed, force_threshold
        self._radius = design.radius
        self._step = min(TRAVEL_SHARE * design.radius / speed, LONGEST_STEP)
        self._travel = self._step * speed
        # Beyond this the actuators pull with all they have, and no force comes to more.
        self._longest_pull = 2.0 * design.force_limit / design.stiffness
        self._finger = Finger(scene.mj_model, scene.mj_data)
        self._lead = speed * self._finger.lag_time
        """How far ahead of the tip its target is while nothing holds it up, metres."""
        self._trace: list[tuple[float, float]] = []
        self.deepest = 0.0
        """How deep the tip was in anything, metres."""
        scene.mj_model.opt.timestep = self._step

    def run(self) -> BallFelt:
        """Move until something is felt, and back; the scene is told where a free object was then.

        Raises:
            ValueError: the tip starts in the object.
        """
        depth, grazed = 0.0, False
        while True:
            met = self._sweep.first_contact(self._start, self._direction, depth)
            if met.outcome == NOTHING:
                return self._nothing()
            # In steps from the start of the ray on, as if all of them were simulated.
            steps = np.floor(met.depth / self._travel) - RUN_UP
            depth, contacts = self._approach(max(depth, steps * self._travel), met.depth)
            if not contacts:
                continue  # it has grazed what a ball would touch, and passed by
            if self._threshold is None:
                felt = self._at_first_contact(contacts, met.depth)
                return self._back(depth, felt)
            first, (depth, contacts) = depth, self._press(depth)
            if contacts:
                felt = self._under_force(contacts, -1.0 if grazed else first - self._travel)
                return self._back(depth, felt)
            if not self._on_its_way(depth):
                return self._back(depth, self._nothing())
            grazed = True
            self._scene.settle()  # the next contact is looked for from an object at rest

    def _approach(self, depth: float, until: float) -> tuple[float, list[TipContact]]:
        """Come to ``depth`` at full speed, and go on until something touches or is passed."""
        self._finger.put(self._start + depth * self._direction, self._speed * self._direction)
        while depth <= until + 2.0 * self._travel:
            contacts = self._drive(depth + self._lead)
            if contacts:
                return depth, contacts
            depth += self._travel
        return depth, []

    def _press(self, depth: float) -> tuple[float, list[TipContact]]:
        """Go on until the force is felt, or nothing any more; no contacts then."""
        quiet = 0
        while True:
            depth += self._travel
            contacts = self._drive(depth + self._lead)
            if sum(contact.force for contact in contacts) >= (self._threshold or 0.0):
                return depth, contacts
            quiet = 0 if contacts else quiet + 1
            if quiet >= CLEAR and self._on_its_way(depth + self._travel):
                return depth + self._travel, []
            if depth - self._progress() > self._longest_pull:
                return depth, []

    def _back(self, depth: float, felt: BallFelt) -> BallFelt:
        """Go back along the ray until the tip is free, and from there to where it came from.

        Returns:
            What was felt, with the forces of it all.
        """
        quiet = 0
        for _ in range(int(MOST_RETREAT / self._step)):
            depth -= self._travel
            quiet = 0 if self._drive(depth) else quiet + 1
            if quiet == CLEAR:
                break
        self._finger.put(self._start, np.zeros(3))
        return replace(felt, forces=np.array(self._trace), deepest=self.deepest)

    def _drive(self, depth: float) -> list[TipContact]:
        """A step with the target at a depth; what the tip touched before it."""
        self._finger.step(self._start + depth * self._direction)
        contacts = list(self._finger.contacts())
        self._trace.append(
            (len(self._trace) * self._step, sum(contact.force for contact in contacts))
        )
        self.deepest = max([self.deepest, *(contact.depth for contact in contacts)])
        return contacts

    def _progress(self) -> float:
        """How far the tip has come along the ray, metres."""
        return float((self._finger.position - self._start) @ self._direction)

    def _on_its_way(self, depth: float) -> bool:
        """Whether the tip is where an undisturbed one is at a depth."""
        there = self._start + depth * self._direction
        return float(np.abs(self._finger.position - there).max()) < ON_ITS_WAY

    def _at_first_contact(self, contacts: list[TipContact], depth: float) -> BallFelt:
        """What is felt at the first step with a contact, taken back to where the tip met it."""
        backs = [self._way_back(contact) for contact in contacts]
        self._scene.follow()
        # Of several, the tip met the one first that it has gone on from the farthest.
        contact, back = max(zip(contacts, backs, strict=True), key=lambda pair: pair[1])
        centre = contact.centre_world - back * self._direction
        position = centre - self._radius * contact.normal_world
        kind = FACE
        if self._outcome(contact) == OBJECT:
            distance, away = self._sweep.closest(contact.geom, centre)
            kind = kind_of(self._scene, centre - away, away / distance)
        return self._felt(contact, position, kind, depth, 0.0)

    def _way_back(self, contact: TipContact) -> float:
        """How far along the ray the tip has come since it met a face so deep, metres.

        In the step before it met nothing, so it is at most the travel of a step.
        """
        slope = -float(contact.normal_world @ self._direction)
        return min(contact.depth / slope, self._travel) if slope > 0.0 else self._travel

    def _under_force(self, contacts: list[TipContact], free: float) -> BallFelt:
        """What is felt once the force is reached: the surface under the tip.

        The nearest place of one part can be inside another only if the tip is deeper in that one;
        so under the deepest contact is the object's own surface.
        """
        self._scene.follow()
        contact = max(contacts, key=lambda one: one.depth)
        distance = self._radius - contact.depth
        position = contact.centre_world - distance * contact.normal_world
        kind = FACE
        if self._outcome(contact) == OBJECT:
            kind = kind_of(self._scene, position, contact.normal_world)
        along = float((contact.centre_world - self._start) @ self._direction)
        return self._felt(contact, position, kind, free, along - free)

    def _felt(
        self, contact: TipContact, position: Floats, kind: int, free: float, pressed: float
    ) -> BallFelt:
        normal = contact.normal_world
        return BallFelt(self._outcome(contact), position, normal, kind, free, pressed)

    def _outcome(self, contact: TipContact) -> int:
        return OBJECT if contact.geom in self._scene.part_geoms else PLANE

    def _nothing(self) -> BallFelt:
        """No force was felt, and how the tip went is not known."""
        return BallFelt(NOTHING, self._start, np.zeros(3), FACE, -1.0)
