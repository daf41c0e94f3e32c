"""What an episode knows of its object: what was felt, as far as it still holds."""

from __future__ import annotations

from dataclasses import dataclass

from ...recognizer import Contacts, FreeSpace
from ..scene.free_body import STILL, Displacement, grown, grown_free_space
from .touch import Touch


@dataclass(frozen=True, eq=False)
class Evidence:
    """Contacts and free space of all probes, with bounds that hold for where the object is now."""

    contacts: Contacts
    """Oldest first."""
    free_space: FreeSpace
    """Likewise."""
    changed: bool = False
    """Whether the last probe has moved the object, so that what was known before has changed."""
    touches: tuple[Touch, ...] = ()
    """What each probe reported."""
    moved: tuple[Displacement, ...] = ()
    """How far the object has moved since each, at most."""

    @classmethod
    def none(cls) -> Evidence:
        """Nothing felt yet."""
        return cls(Contacts.none(), FreeSpace.none())

    def after(self, touch: Touch, limit: float) -> Evidence:
        """What is known after a further probe.

        Args:
            touch: what it reported.
            limit: contacts and paths of an object that has moved are dropped once their places are
                known to no better than this, metres.
        """
        touches = (*self.touches, touch)
        if touch.displacement == STILL:
            contacts = Contacts.join([self.contacts, touch.contacts])
            paths = FreeSpace.join([self.free_space, touch.free_space])
            return Evidence(contacts, paths, False, touches, (*self.moved, STILL))
        moved = (*(far + touch.displacement for far in self.moved), STILL)
        pairs = list(zip(touches, moved, strict=True))
        # Within its own probe an approach may be off by what the object turned in it.
        contacts = [
            grown(one.contacts, far, limit=limit, approach_error=one.displacement.turn)
            for one, far in pairs
        ]
        paths = [grown_free_space(one.free_space, far, limit=limit) for one, far in pairs]
        return Evidence(Contacts.join(contacts), FreeSpace.join(paths), True, touches, moved)
