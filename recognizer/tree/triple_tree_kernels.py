"""Compiled forward checking of a tree that is grown a level at a time."""

from __future__ import annotations

import numpy as np

from ..compiling import kernel


@kernel
def look_ahead(rows, domains, masks, stop, keep):
    """Drop interpretations that leave some later contact without a face.

    Args:
        rows: (m, k) a face for each of the first k contacts.
        domains: (n, w) bit sets, the faces each contact may be on.
        masks: (n, n, f, w) which faces of one contact go with a face of another.
        stop: contacts from it on are not looked at.
        keep: (m,) set to False in place.
    """
    level = rows.shape[1]
    words = domains.shape[1]
    for m in range(len(rows)):
        for j in range(level, stop):
            some = np.uint64(0)
            for w in range(words):
                bits = domains[j, w]
                for i in range(level):
                    bits &= masks[i, j, rows[m, i], w]
                some |= bits
            if some == np.uint64(0):
                keep[m] = False
                break
