"""The memo's printed figures as data, and the rule by which rows are judged against them."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest

from palpate.assets import memo
from palpate.scripts.memo.judge import Row, four, judge

# --- The memo's figures -----------------------------------------------------------------------


def test_the_tables_have_as_many_rows_as_the_memo_prints():
    counts = {
        memo.table1: 6,
        memo.table2: 23,
        memo.table4: 23,
        memo.table5: 13,
        memo.table6: 8,
        memo.table7: 8,
        memo.table8: 8,
        memo.table9: 8,
        memo.table10: 14,
        memo.table11: 14,
        memo.range_views: 2,
    }
    assert {table: len(table()) for table in counts} == counts


def test_figures_of_a_row_are_in_order():
    tables = (memo.table2, memo.table4, memo.table6, memo.table7, memo.table8, memo.table9)
    levels = (memo.table10, memo.table11)
    for row in itertools.chain.from_iterable(table() for table in (*tables, *levels)):
        assert 1 <= row.smallest <= row.median <= row.p90 <= row.largest, row


def test_tables_of_the_same_runs_have_the_same_rows():
    def about(rows):
        return [(row.object_name, row.pi_over, row.position_error_in) for row in rows]

    assert about(memo.table2()) == about(memo.table4())
    assert about(memo.table7()) == about(memo.table8()) == about(memo.table9())
    # Each step leaves no more than the one before.
    for before, after in itertools.chain(
        zip(memo.table2(), memo.table4(), strict=True),
        zip(memo.table7(), memo.table8(), strict=True),
        zip(memo.table8(), memo.table9(), strict=True),
    ):
        assert after.median <= before.median
        assert after.largest <= before.largest


def test_histograms_of_table_1_have_the_medians_that_the_text_states():
    """The placing of cells that the print leaves open is checked by it."""
    ends = [*range(1, 11), *range(20, 101, 10), np.inf]
    for row in memo.table1():
        total = sum(row.runs)
        assert total == (247 if (row.object_name, row.direction) == ("wrench", False) else 250)
        at = int(np.searchsorted(np.cumsum(row.runs), total / 2))
        low = 1 if at == 0 else ends[at - 1] + 1
        assert low <= row.median <= ends[at], row
        if row.largest is not None:
            last = int(np.flatnonzero(row.runs)[-1])
            assert row.largest <= ends[last]
    assert len(memo.planar_bins()) == len(ends)


def test_some_figures_are_those_of_the_print():
    assert memo.table4()[2] == memo.CountRow("housing", 15, 0.1, 1, 1, 2, 12)
    assert memo.table6()[4] == memo.ClusterRow("stapler", 10, 0.01, 0.01, 1, 4, 14, 57)
    assert memo.table8()[-1] == memo.CountRow("housing-34", 8, 0.05, 1, 32, 104, 377)
    assert memo.table10()[3] == memo.LevelRow(5, 4, 40, 244, memo.LARGEST_PRINTED)
    assert memo.timing().prune_seconds == 1.27


def test_what_ails_the_print_is_said():
    assert "no figure of it can be trusted" in memo.place("table3").damage
    assert memo.place("table2").section == "4.3"
    with pytest.raises(ValueError, match=r"no 'table12'; there are: table1"):
        memo.place("table12")


# --- The rule ---------------------------------------------------------------------------------


def row(level: float, memo_median: float | None, ours: float) -> Row:
    printed = None if memo_median is None else (1.0, memo_median, 1e4, 1e4)
    return Row((f"{level}",), "box", (level,), printed, (1.0, ours, 1e4, 1e4))


def judged(*rows: Row) -> list[str]:
    comparisons = judge(rows, lambda _: "far", lambda *_: "disordered", "nothing printed")
    return [f"{each.verdict}: {each.why}" if each.why else each.verdict for each in comparisons]


def test_a_median_may_be_off_by_a_factor_of_four_and_no_more():
    assert judged(row(1, 10, 40)) == judged(row(1, 10, 2.5)) == ["within"]
    assert judged(row(1, 10, 40.1)) == ["outside: median 4 times the memo's: far"]
    assert judged(row(1, 10, 2.4)) == ["outside: median 0.24 times the memo's: far"]


def test_a_median_may_not_fall_where_the_memos_rises():
    assert judged(row(1, 10, 12), row(2, 20, 12)) == ["within", "within"]
    first, second = judged(row(1, 10, 12), row(2, 20, 11))
    assert first == "within"
    assert re.match(r"outside: .* from 10 to 20 after 1, ours from 12 to 11: disordered", second)


def test_rows_in_any_order_where_the_memos_are_even():
    assert judged(row(1, 10, 12), row(2, 10, 11)) == ["within", "within"]


def test_a_row_is_compared_with_the_next_lower_one():
    assert judged(row(3, 30, 12), row(1, 10, 20), row(2, 20, 11))[0] == "within"


def test_what_the_memo_does_not_print_is_not_judged():
    assert judged(row(1, None, 12)) == ["not judged: nothing printed"]


def test_four_figures_of_counts():
    assert four(range(1, 102)) == (1.0, 51.0, 91.0, 101.0)
