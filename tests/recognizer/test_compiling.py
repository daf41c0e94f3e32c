"""Compiled kernels: never stale, compiled once and with a word, kept whatever happens.

Each test has a palpate of its own: the modules that compile and keep, with two kernels of which one
calls the other.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import palpate.recognizer
from palpate.recognizer import kernel_store

OURS = Path(palpate.recognizer.__file__).parent
MACHINERY = ("compiling.py", "linking.py", "kernel_store.py", "preparing.py")
CALLEE = """
from .compiling import borrowing, kernel

@borrowing
def scaled(number, times):
    return FACTOR * number * times
"""
CALLER = """
from .compiling import kernel
from .inner_kernels import scaled

@kernel
def twice_and_thrice(number):
    return scaled(number, 2) + scaled(number, 3)
"""
WARM_UP = """
import os, time
from pathlib import Path
from .outer_kernels import twice_and_thrice

def first():
    twice_and_thrice(1.0)
    with open(Path(__file__).with_name("compiled.log"), "a") as log:
        log.write("compiled ")

def second():
    time.sleep(float(os.environ.get("SECOND_TAKES", "0")))

PARTS = (first, second)
"""
CALL = (
    "from palpate.recognizer.outer_kernels import twice_and_thrice as called;"
    "print(called(1.0), *called._cache_hits.values())"
)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """The folder of a recogniser that has two kernels."""
    package = tmp_path / "palpate" / "recognizer"
    package.mkdir(parents=True)
    for name in MACHINERY:
        shutil.copy(OURS / name, package)
    (package / "__init__.py").touch()
    (package / "warm_up.py").write_text(WARM_UP)
    (package / "outer_kernels.py").write_text(CALLER)
    (package / "inner_kernels.py").write_text(CALLEE.replace("FACTOR", "10.0"))
    return package


def start(package: Path, code: str = CALL, **environment: str) -> subprocess.Popen[str]:
    given = {**os.environ, "PYTHONPATH": str(package.parent.parent), **environment}
    return subprocess.Popen(
        [sys.executable, "-P", "-c", code],
        env=given,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=package,
        start_new_session=True,
    )


def run(package: Path, code: str = CALL, **environment: str) -> tuple[str, str]:
    process = start(package, code, **environment)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out.strip(), err


def kept(package: Path) -> set[str]:
    return {path.name for path in (package / "__pycache__" / "kernels").rglob("*.nbc")}


def test_the_first_use_says_that_it_compiles_and_the_second_finds_it_done(small):
    out, err = run(small)
    assert out == "50.0 1"
    assert "once" in err
    assert str(small / "__pycache__" / "kernels") in err
    assert run(small) == ("50.0 1", "")


def test_a_kernel_is_compiled_anew_when_one_that_it_calls_was_changed(small):
    assert run(small)[0] == "50.0 1"
    before = kept(small)
    (small / "inner_kernels.py").write_text(CALLEE.replace("FACTOR", "20.0"))
    out, err = run(small)
    assert out == "100.0 1"
    assert "once" in err
    assert kept(small) == before, "what is stale is removed"


def test_a_process_that_started_before_a_change_goes_on_as_it_started(small):
    waits = CALL.replace("print(", "open('started', 'w').close();input();print(")
    process = start(small, waits)
    while not (small / "started").exists():
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.05)
    (small / "inner_kernels.py").write_text(CALLEE.replace("FACTOR", "20.0"))
    assert run(small)[0] == "100.0 1"
    after = kept(small)
    assert process.communicate("\n", timeout=120)[0].split()[0] == "50.0"
    assert kept(small) >= after
    assert run(small) == ("100.0 1", "")


def test_constants_do_not_have_a_callee_compiled_again(small):
    code = (
        "from palpate.recognizer.outer_kernels import twice_and_thrice as called, scaled;"
        "called(1.0); print(len(scaled._part.signatures))"
    )
    assert run(small, code, PALPATE_COMPILES_HERE="1")[0].split()[-1] == "1"


def test_four_processes_at_once_compile_once(small):
    processes = [start(small) for _ in range(4)]
    told = [process.communicate(timeout=120)[0].strip() for process in processes]
    assert told == ["50.0 1"] * 4
    assert (small / "compiled.log").read_text() == "compiled "


def test_an_interrupt_ends_it_at_once_and_keeps_what_was_finished(small):
    process = start(small, SECOND_TAKES="600")
    log = small / "compiled.log"
    while not log.exists():
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) != 0
    assert "KeyboardInterrupt" in process.communicate()[1]
    before = kept(small)
    assert before
    assert run(small)[0] == "50.0 1"
    assert kept(small) == before
    assert log.read_text() == "compiled ", "the second time it was found done"


def test_a_process_that_cannot_compile_says_why(small):
    (small / "warm_up.py").write_text("PARTS = (lambda: 1 / 0,)")
    process = start(small)
    assert "ZeroDivisionError" in process.communicate(timeout=120)[1]
    assert process.returncode != 0


def folder_of(monkeypatch: pytest.MonkeyPatch, *writable: Path) -> Path | None:
    """Where kernels are kept if only what is below some folders can be written."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(
        kernel_store, "_writable", lambda place: any(place.is_relative_to(w) for w in writable)
    )
    return kernel_store.kernel_folder.__wrapped__()


def test_kernels_are_kept_beside_the_source_or_where_the_user_can_write(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_store, "ROOT", tmp_path / "site-packages")
    cache, temporary = tmp_path / "cache", tmp_path / "tmp"
    temporary.mkdir()
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *_, **__: cache)
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(temporary))
    beside = folder_of(monkeypatch, tmp_path)
    assert beside is not None
    assert beside.is_relative_to(tmp_path / "site-packages")
    in_cache = folder_of(monkeypatch, cache, temporary)
    assert in_cache is not None
    assert in_cache.is_relative_to(cache)
    in_temporary = folder_of(monkeypatch, temporary)
    assert in_temporary is not None
    assert in_temporary.is_relative_to(temporary)
    assert folder_of(monkeypatch) is None


def test_what_was_prepared_beside_the_source_is_used_where_that_cannot_be_written(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(kernel_store, "ROOT", tmp_path / "site-packages")
    beside = folder_of(monkeypatch, tmp_path)
    assert beside is not None
    beside.mkdir(parents=True)
    (beside / kernel_store.PREPARED).write_text(kernel_store.mark())
    assert folder_of(monkeypatch) == beside
    (beside / kernel_store.PREPARED).write_text("for another processor")
    assert folder_of(monkeypatch) is None


def test_a_folder_that_somebody_else_may_write_is_not_trusted(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_store, "ROOT", tmp_path / "site-packages")
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *_, **__: Path("~/.cache/palpate"))
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    theirs = tmp_path / f"palpate-{os.getuid()}"
    theirs.mkdir(mode=0o777)
    theirs.chmod(0o777)
    assert folder_of(monkeypatch, theirs) is None
