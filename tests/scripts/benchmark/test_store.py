"""Rows of a benchmark on disk: whole, once, and gathered while others read."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers.made_up_rows import made_up_row, small

from palpate.scripts.benchmark import store as benchmark_store
from palpate.scripts.benchmark.run import run_benchmark
from palpate.scripts.benchmark.store import RowStore


def test_rows_come_back_from_disk_as_they_were(tmp_path):
    rows = [made_up_row(job) for job in small().jobs()]
    rows[3] = replace(rows[3], right=None, rotation_error=None, decision_median=None)
    store = RowStore(tmp_path)
    for row in rows[::-1]:
        store.add(row)
    assert store.rows() == rows
    store.gather()
    assert RowStore(tmp_path).rows() == rows
    assert [path.name for path in tmp_path.iterdir()] == ["episodes.parquet"]


def test_the_table_can_be_read_without_palpate(tmp_path):
    import pyarrow.parquet

    run_benchmark(small(), tmp_path, made_up_row)
    table = pyarrow.parquet.read_table(tmp_path / "episodes.parquet")
    assert table.num_rows == 20
    assert table["policy"].to_pylist()[:2] == ["random", "quick"]
    assert len(table["hypotheses"][0].as_py()) == table["probes"][0].as_py()


def test_rows_are_gathered_when_they_get_many(tmp_path, monkeypatch):
    monkeypatch.setattr(benchmark_store, "MOST_PARTS", 4)
    rows = [made_up_row(job) for job in small().jobs()][:10]
    store = RowStore(tmp_path)
    for row in rows:
        store.add(row)
    assert len(list((tmp_path / "parts").iterdir())) == 2
    assert store.rows() == rows


def test_rows_can_be_read_while_another_process_gathers_them(tmp_path, monkeypatch):
    rows = [made_up_row(job) for job in small().jobs()]
    writer, reader = RowStore(tmp_path), RowStore(tmp_path)
    for row in rows:
        writer.add(row)
    read = benchmark_store._read

    def read_late(path):
        if path.name == f"{rows[5].number:08d}.parquet":
            monkeypatch.setattr(benchmark_store, "_read", read)
            writer.gather()
        return read(path)

    monkeypatch.setattr(benchmark_store, "_read", read_late)
    assert reader.rows() == rows


def test_a_row_that_is_in_two_files_counts_once_and_the_older_one_stays(tmp_path):
    first, other = [made_up_row(job) for job in small().jobs()][:2]
    store = RowStore(tmp_path)
    store.add(first)
    store.gather()
    store.add(replace(first, contacts=99))
    store.add(other)
    assert store.rows() == [first, other]
    store.gather()
    assert store.rows() == [first, other]


def test_what_was_half_written_is_cleared_away_and_what_is_damaged_is_named(tmp_path):
    run_benchmark(small(episodes=1), tmp_path, made_up_row)
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / ".00000001.parquet.half").write_bytes(b"PAR1")
    run_benchmark(small(episodes=1), tmp_path, made_up_row)
    assert not (tmp_path / "parts").exists()
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "00000001.parquet").write_bytes(b"PAR1 cut short")
    with pytest.raises(ValueError, match=r"00000001\.parquet: not a whole table"):
        run_benchmark(small(episodes=1), tmp_path, made_up_row)
