"""Why nothing fits: the mistakes that are made with probes and files, tried one by one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import pdist

from ..belief import Belief
from ..contacts.contacts import Contacts
from ..contacts.free_space import FreeSpace
from ..contacts.support import SupportPlane
from ..recognize import Recognizer

Floats = NDArray[np.float64]

SCALES = {
    25.4: "in inches, not millimetres",
    1.0 / 25.4: "in millimetres, not inches",
    1000.0: "in metres, not millimetres",
    0.001: "in millimetres, not metres",
    10.0: "in centimetres, not millimetres",
    0.0254: "in inches, not metres",
    1.0 / 0.0254: "in metres, not inches",
}
"""What a length is multiplied by that was written in one unit and read in another."""
WIDER = 3.0
"""How much wider bounds are tried."""
BLURRED = 0.02
"""Share of the contacts' distance that bounds are widened to, at most, with other units."""
ENOUGH = 4
"""Contacts below which anything fits somewhere, so that a fit says nothing."""


@dataclass(frozen=True, eq=False)
class Finding:
    """A change after which the contacts do fit something."""

    explanation: str
    """What seems to be wrong, as a clause."""
    belief: Belief
    """Of the changed contacts."""
    contact: int | None = None
    """The place of the one contact that it is about, if it is about one."""


def diagnose(
    recognizer: Recognizer,
    contacts: Contacts,
    *,
    free_space: FreeSpace | None = None,
    support: SupportPlane | None = None,
) -> list[Finding]:
    """What may be wrong with contacts that fit no object.

    Tried are a support or paths that aren't as said, normals that point inwards, other units of
    length, bounds that are too tight, and one touch of something else.

    Args:
        recognizer: with the library.
        contacts: which it found nothing for.
        free_space: with these paths, if any.
        support: and this plane, if any.

    Returns:
        What made them fit, the likeliest first.
    """
    findings = []
    for known, words in (
        (support, "the part doesn't lie on the plane as was said"),
        (free_space, "some way that was said to be free goes through the part"),
    ):
        if known is None or not len(contacts):
            continue
        kept = free_space if known is support else None
        plane = None if known is support else support
        belief = recognizer.recognize(contacts, free_space=kept, support=plane)
        if not belief.empty:
            findings.append(Finding(words, belief))
    if findings or len(contacts) < ENOUGH:
        return findings
    if (contacts.normal_error < np.pi / 2.0).any():
        belief = recognizer.recognize(_changed(contacts, normals=-contacts.normals))
        if not belief.empty:
            findings.append(Finding("the normals point inwards, not out of the object", belief))
    findings += _other_units(recognizer, contacts)
    belief = recognizer.recognize(_changed(contacts, wider=WIDER))
    if not belief.empty:
        words = f"the bounds are too tight: they fit with bounds {WIDER:g} times as wide"
        findings.append(Finding(words, belief))
    if not findings and len(contacts) > ENOUGH:
        belief = recognizer.recognize(contacts, outliers=1)
        if not belief.empty:
            row = int(np.flatnonzero(belief.hypotheses[0].interpretations[0] < 0)[0])
            words = f"contact {row + 1} is on something else: the others fit without it"
            findings.append(Finding(words, belief, contact=row))
    return findings


def too_far_apart(recognizer: Recognizer, contacts: Contacts) -> float | None:
    """How many times farther apart contacts are than any object is large; None if they aren't."""
    if len(contacts) < 2:
        return None
    apart = float(pdist(contacts.positions).max()) - 2.0 * float(contacts.position_error.max())
    largest = max(model.diameter for model in recognizer.models)
    return apart / largest if apart > largest else None


def _other_units(recognizer: Recognizer, contacts: Contacts) -> list[Finding]:
    findings = []
    apart = float(pdist(contacts.positions).max())
    for factor, words in SCALES.items():
        # Contacts all within a small part of an object would fit anything.
        sizes = [model.diameter for model in recognizer.models]
        if not any(0.2 * size < factor * apart < 1.1 * size for size in sizes):
            continue
        # If it is the library that has other units, bounds grow with the contacts.
        largest = BLURRED * factor * apart / float(contacts.position_error.max())
        for blur in (1.0, max(min(factor, largest), 1.0)):
            scaled = _changed(contacts, positions=factor * contacts.positions, blur=blur)
            belief = recognizer.recognize(scaled)
            if not belief.empty:
                size = f"{factor:.4g} times too small"
                if factor < 1.0:
                    size = f"{1.0 / factor:.4g} times too large"
                told = f"the contacts are {size}: they are {words}, or the library is not"
                findings.append(Finding(told, belief))
                break
    return findings


def _changed(
    contacts: Contacts,
    *,
    positions: Floats | None = None,
    normals: Floats | None = None,
    wider: float = 1.0,
    blur: float = 1.0,
) -> Contacts:
    """Contacts with other positions or normals, or wider bounds (``blur``: on positions)."""
    return Contacts(
        contacts.positions if positions is None else positions,
        contacts.normals if normals is None else normals,
        position_error=wider * blur * contacts.position_error,
        normal_error=np.minimum(wider * contacts.normal_error, np.pi),
        approaches=contacts.approaches,
        kinds=contacts.kinds,
    )
