"""What a film of an episode shows, picture by picture.

Each probe has three parts. Its tip goes along each ray to where it ended, and what it felt appears;
rivals that this ruled out fade, and others take their place; then all stands still for a moment.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...recognizer import Contacts
from ..sensors.touch import Touch
from . import view as look
from .caption import Caption, belief_text, length_text
from .episode import Episode
from .episode_picture import bare_scene, likeness_of
from .film_approach import approach, seconds_of
from .picture_scene import PictureScene
from .rivals import Cast, Shown, ghost_of

__all__ = ["FRAME_RATE", "EpisodeRecord", "FilmScript", "Shot"]

FRAME_RATE = 25
LETTERS = 1.35
"""Scale of the captions: a film is looked at from farther away than a picture."""
ROOM = 1.12
"""How many times farther away the camera is than it must be, for the tips to be seen coming."""

OPENING, FADE, REST, ENDING = 1.2, 0.7, 0.3, 2.4
"""Seconds before the first probe, for rivals to fade, still after a probe, still at the end."""
LONGEST = 40.0
"""Seconds for all probes together; many are shown faster."""


@dataclass(frozen=True, eq=False)
class EpisodeRecord:
    """What a film is made of."""

    start: Episode
    """As it stood before the first probe."""
    probes: tuple[Episode, ...]
    """As it stood after each probe."""
    verdict: tuple[str, str]
    """What came of it: a line, and a line below it."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture, and for how many frames it is shown."""

    scene: PictureScene
    caption: Caption
    frames: int


class FilmScript:
    """The pictures of an episode, in order."""

    def __init__(self, record: EpisodeRecord, size: tuple[int, int], every: int = 1) -> None:
        """Choose what is shown, and from where.

        Args:
            record: the episode.
            size: of the pictures, (width, height) pixels.
            every: for how many frames a picture is shown at least.
        """
        self._record, self._every = record, every
        self._states = record.start, *record.probes
        self._model = record.start.true_object
        likeness = likeness_of(self._states[-1])
        self._library = likeness.library
        self._casts = [Cast()]
        for state in record.probes:
            truth = self._model.name, state.T_world_object
            self._casts.append(self._casts[-1].next(state.belief, likeness, truth))
        self.stage = look.Stage.of(self._everything(), size, ROOM)
        """The camera and the plane of all pictures."""
        usual = sum(seconds_of(state.touches[-1]) + FADE + REST for state in record.probes)
        self._pace = min(1.0, LONGEST / max(usual, 1e-9))

    def shots(self) -> Iterator[Shot]:
        """All pictures."""
        among = f"one of {len(self._library)} that palpate knows"
        told = (f"An unknown object, {among}", "Shown as it truly lies, which palpate is not told")
        yield self._still(self._states[0], Cast(), told, OPENING)
        for number, (before, after) in enumerate(pairwise(self._states), 1):
            title = f"Probe {number} of {len(self._record.probes)}"
            told = title, belief_text(before.belief)
            yield from self._approach(before, after.touches[-1], self._casts[number - 1], told)
            yield from self._fade(after, self._casts[number], (title, belief_text(after.belief)))
        yield self._still(self._states[-1], self._casts[-1], self._record.verdict, ENDING)

    def _approach(
        self, before: Episode, touch: Touch, cast: Cast, told: tuple[str, str]
    ) -> Iterator[Shot]:
        still = self._still(before, cast, told, 0.0)
        felt = bare_scene(self._model, before.T_world_object, touch.contacts)
        positions = np.concatenate([before.contacts.positions, felt.contacts_world])
        for moment in approach(touch, self.stage.view.radius, self._pictures):
            seen = np.append(np.ones(len(before.contacts), bool), moment.growth > 0.0)
            grown = felt.normals_world * moment.growth[:, None]
            scene = replace(
                still.scene,
                rays_world=moment.rays_world,
                ray_hits=moment.ray_hits,
                tips=moment.tips,
                contacts_world=positions[seen],
                normals_world=np.concatenate([still.scene.normals_world, grown])[seen],
            )
            yield Shot(scene, still.caption, self._every)

    def _fade(self, after: Episode, cast: Cast, told: tuple[str, str]) -> Iterator[Shot]:
        """Rivals go and come after a probe; its rays stay in the picture."""
        *_, last = approach(after.touches[-1], self.stage.view.radius, lambda _: 1)
        changes = bool(cast.gone or cast.new)
        count = self._pictures(FADE) if changes else 1
        rest = max(round(REST * self._pace * FRAME_RATE), 1)
        for step in range(1, count + 1):
            share = step / count if changes else 1.0
            still = self._still(after, cast, told, 0.0, share)
            scene = replace(still.scene, rays_world=last.rays_world, ray_hits=last.ray_hits)
            yield Shot(scene, still.caption, self._every + (rest if step == count else 0))

    def _still(
        self,
        state: Episode,
        cast: Cast,
        told: tuple[str, str],
        seconds: float,
        share: float = 1.0,
    ) -> Shot:
        """A picture without a probe; ``share`` is how far rivals have come and gone."""
        opacities = [(one, 1.0) for one in cast.stayed]
        if share < 1.0:
            opacities += [(one, 1.0 - share) for one in cast.gone]
        opacities += [(one, share) for one in cast.new]
        ghosts = [
            ghost_of(one.rival, self._library, str(one.colour), one.colour, opacity)
            for one, opacity in opacities
        ]
        scene = bare_scene(self._model, state.T_world_object, state.contacts, ghosts)
        legend = (self._rivals_legend(cast, share), self._fixed_legend())
        return Shot(scene, Caption(*told, legend, LETTERS), round(seconds * FRAME_RATE))

    def _everything(self) -> PictureScene:
        """All that the film shows of object, contacts and rivals, in one scene."""
        touched = [state.touches[-1].contacts for state in self._record.probes]
        felt = Contacts.join([Contacts.none(), *touched])
        rivals = [one.rival for cast in self._casts for one in cast.new]
        ghosts = [ghost_of(rival, self._library, "") for rival in rivals]
        scene = bare_scene(self._model, self._states[0].T_world_object, felt, ghosts)
        corners = [state.T_world_object.apply(self._model.vertices) for state in self._states]
        return replace(scene, object_vertices_world=np.concatenate(corners))

    def _pictures(self, seconds: float) -> int:
        return max(round(seconds * self._pace * FRAME_RATE / self._every), 1)

    def _fixed_legend(self) -> tuple[tuple[look.Colour, str], ...]:
        return (
            (look.OBJECT, "the true object"),
            (look.CONTACT, "contact, felt normal"),
            (look.RAY_HIT, "touched"),
            (look.RAY_MISSED, "touched nothing"),
            (look.GRID, f"grid {length_text(self.stage.step)}"),
        )

    def _rivals_legend(self, cast: Cast, share: float) -> tuple[tuple[look.Colour, str], ...]:
        def entry(one: Shown, fate: str) -> tuple[look.Colour, str]:
            return look.GHOSTS[one.colour], f"{fate} {one.rival.object_name}"

        fading = cast.gone if share < 1.0 else ()
        # While one fades, what takes its place waits for its line.
        taken = {one.colour for one in fading}
        there = [one for one in cast.stayed + cast.new if one.colour not in taken]
        entries = [entry(one, "maybe") for one in there]
        entries += [entry(one, "ruled out:") for one in fading]
        entries.sort(key=lambda told: look.GHOSTS.index(told[0]))
        if cast.more and share == 1.0:
            entries.append((look.PLANE, f"and {cast.more} more"))
        return tuple(entries)
