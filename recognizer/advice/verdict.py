"""What a belief amounts to, in a word."""

from __future__ import annotations

from enum import Enum

from ..belief import Belief


class Verdict(Enum):
    """How far the contacts have got."""

    UNTOUCHED = "nothing touched yet"
    UNIQUE = "unique"
    AMBIGUOUS = "ambiguous"
    UNDERDETERMINED = "underdetermined"
    UNKNOWN = "not in this library"
    CUT_SHORT = "cut short"


def verdict(belief: Belief | None) -> Verdict:
    """The verdict on a belief.

    `UNIQUE`: one object at one pose, up to its symmetry. `AMBIGUOUS`: several, each fixed.
    `UNDERDETERMINED`: some may still be shifted or turned. `UNKNOWN`: none. `CUT_SHORT`: a budget
    ran out, so that rivals may be missing.
    """
    if belief is None:
        return Verdict.UNTOUCHED
    if not belief.complete:
        return Verdict.CUT_SHORT
    if belief.empty:
        return Verdict.UNKNOWN
    if belief.unique:
        return Verdict.UNIQUE
    if all(hypothesis.determined for hypothesis in belief.hypotheses):
        return Verdict.AMBIGUOUS
    return Verdict.UNDERDETERMINED
