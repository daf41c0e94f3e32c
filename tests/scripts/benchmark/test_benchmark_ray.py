"""`palpate benchmark --backend ray`: the rows of the serial run, with a machine lost on the way."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.checkout import TESTS
from helpers.made_up_rows import made_up_row, small

from palpate.scripts.benchmark.store import RowStore

# Ray warns as it likes and starts threads: it runs in processes of its own.
pytest.importorskip("ray", reason="palpate[ray] isn't installed")

LOCAL = """
import sys
from pathlib import Path
from helpers.made_up_rows import made_up_row, small
from palpate.scripts.benchmark.run import run_benchmark

run_benchmark(small(), Path(sys.argv[1]), made_up_row, workers=2, backend="ray")
"""

TWO_NODES = """
import sys, time
from pathlib import Path

import ray
from helpers.made_up_rows import made_up_row, small
from palpate.scripts.benchmark.run import run_benchmark
from palpate.scripts.benchmark.store import RowStore
from ray.cluster_utils import Cluster

cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
other = cluster.add_node(num_cpus=1)
ray.init(address=cluster.address, log_to_driver=False)
where = set()

def play(job):
    time.sleep(0.2)
    node = ray.get_runtime_context().get_node_id()
    return made_up_row(job, versions=node)

def add_and_kill(store, row, add=RowStore.add):
    add(store, row)
    where.add(row.versions)
    if len(where) == 2 and len(cluster.worker_nodes) == 1:
        cluster.remove_node(other, allow_graceful=False)

RowStore.add = add_and_kill
run_benchmark(small(), Path(sys.argv[1]), play, workers=4, backend="ray")
assert not cluster.worker_nodes, "nothing was killed"
ray.shutdown()
cluster.shutdown()
"""


def run(program: str, folder: Path) -> None:
    # Ray's own processes read the path from here.
    path = os.pathsep.join([str(TESTS), *sys.path])
    told = subprocess.run(
        [sys.executable, "-c", program, str(folder)],
        env={**os.environ, "PYTHONPATH": path, "RAY_USAGE_STATS_ENABLED": "0"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert told.returncode == 0, told.stderr


@pytest.mark.parametrize("program", [LOCAL, TWO_NODES], ids=["local", "one-of-two-killed"])
def test_rows_are_those_of_the_serial_run(tmp_path, program):
    run(program, tmp_path)
    # What played a row is written in it, and differs by design.
    found = [replace(row.untimed(), versions="") for row in RowStore(tmp_path).rows()]
    assert found == [made_up_row(job, versions="").untimed() for job in small().jobs()]
