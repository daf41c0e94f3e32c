"""Interpretations are found again in a hash table as in a plain dictionary of their rows."""

import numpy as np

from palpate.recognizer.tree.leaf_kernels import place_of, table_of


def test_a_row_is_found_at_its_place_and_no_other_row_is() -> None:
    rng = np.random.default_rng(0)
    for count in (0, 1, 7, 16):
        # So few features that most rows differ in one contact alone; -1 stands for none.
        drawn = np.unique(rng.integers(-1, 3, (200, 3)), axis=0)
        rng.shuffle(drawn)
        rows = np.empty((16, 3), np.int32)
        rows[:count] = drawn[:count]
        plain = {tuple(row): number for number, row in enumerate(rows[:count].tolist())}
        slots = table_of(rows, count)
        for row in drawn:
            assert slots[place_of(row, rows, slots)] == plain.get(tuple(row.tolist()), -1)
