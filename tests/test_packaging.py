"""What is installed is what lies here, and data flows one way.

The folders at the top of the repository are installed as ``palpate.<folder>``: an arrangement with
one trap (a new folder works from a checkout and is missing in a wheel), which these tests close.
"""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SETUPTOOLS = PROJECT["tool"]["setuptools"]
FOLDERS = tuple(sorted(SETUPTOOLS["package-dir"].values()))

MAY_IMPORT = {
    "assets": {"assets"},
    "recognizer": {"recognizer"},
    "policies": {"policies", "assets", "recognizer"},
    "envs": {"envs", "assets", "recognizer"},
    "scripts": {"scripts", "policies", "envs", "assets", "recognizer"},
}
RECOGNIZER_STANDS_ON = {
    *("numpy", "scipy", "trimesh", "numba", "platformdirs"),
    *sys.stdlib_module_names,
}


def files_of(folder: str) -> list[Path]:
    inside = (ROOT / folder).rglob("*")
    return [path for path in inside if path.is_file() and "__pycache__" not in path.parts]


def modules_of(folder: str) -> list[Path]:
    return [path for path in files_of(folder) if path.suffix == ".py"]


def import_name(path: Path) -> str:
    """``palpate.envs.pictures.picture`` for the file ``envs/pictures/picture.py``."""
    return ".".join(("palpate", *path.relative_to(ROOT).with_suffix("").parts))


def imports_of(source: str, module: str) -> Iterator[str]:
    """Absolute names of everything that ``source``, the text of ``module``, imports anywhere."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = module.split(".")[: -node.level] if node.level else []
            package = [*above, *(node.module or "").split(".")] if node.module else above
            yield from (".".join([*package, alias.name]) for alias in node.names)


def forbidden_imports(source: str, module: str) -> list[str]:
    """The imports in ``source`` that ``module`` must not make."""
    folder = module.split(".")[1]
    found = []
    for name in imports_of(source, module):
        top, *rest = name.split(".")
        if top in FOLDERS:
            found.append(f"{module} imports {name}: say palpate.{name}, or import relatively")
        elif top == "palpate" and (not rest or rest[0] not in MAY_IMPORT[folder]):
            found.append(f"{module} imports {name}: against the flow")
        elif folder == "recognizer" and top != "palpate" and top not in RECOGNIZER_STANDS_ON:
            found.append(f"{module} imports {name}: the recogniser stands on less")
    return found


def run_python(code: str) -> str:
    finished = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout + finished.stderr


def test_every_folder_of_code_or_data_is_installed():
    on_disk = {path.parent for folder in FOLDERS for path in files_of(folder)}
    assert {import_name(path) for path in on_disk} == set(SETUPTOOLS["packages"])


def test_every_data_file_is_installed():
    globs = SETUPTOOLS["package-data"]
    forgotten = [
        path.relative_to(ROOT)
        for folder in FOLDERS
        for path in files_of(folder)
        if path.suffix != ".py"
        and not any(path.match(g) for g in globs["*"] + globs.get(import_name(path.parent), []))
    ]
    assert forgotten == []


def test_every_folder_says_it_is_typed():
    assert [folder for folder in FOLDERS if not (ROOT / folder / "py.typed").is_file()] == []


def test_installed_version_is_the_one_written_down():
    installed = importlib.metadata.version("palpate")
    assert installed == PROJECT["project"]["version"], "install again: rm -rf .venv, then make test"


def test_data_flows_one_way():
    assert set(FOLDERS) == set(MAY_IMPORT)
    found = [
        complaint
        for folder in FOLDERS
        for path in modules_of(folder)
        for complaint in forbidden_imports(path.read_text(encoding="utf-8"), import_name(path))
    ]
    assert found == []


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("palpate.recognizer.tree.tree", "import mujoco"),
        ("palpate.recognizer.tree.tree", "def f():\n    from ..assets import mesh_path"),
        ("palpate.assets.build", "from .. import recognizer"),
        ("palpate.policies.greedy", "from palpate.envs import picture"),
        ("palpate.envs.probe", "from ..policies.greedy import Greedy"),
        ("palpate.envs.probe", "import recognizer"),
    ],
)
def test_an_import_against_the_flow_is_noticed(module, line):
    assert len(forbidden_imports(line, module)) == 1


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("palpate.recognizer.tree.tree", "import os.path, numpy as np\nfrom . import tree_kernels"),
        ("palpate.envs.probe", "import mujoco\nfrom ..recognizer.contacts import Contacts"),
        (
            "palpate.scripts.commands.episode",
            "from ..envs import picture\nfrom palpate.policies import x",
        ),
    ],
)
def test_an_import_along_the_flow_is_allowed(module, line):
    assert forbidden_imports(line, module) == []


@pytest.mark.parametrize("folder", FOLDERS)
def test_star_import_finds_every_name_it_promises(folder):
    names: dict[str, object] = {}
    exec(f"from palpate.{folder} import *", names)
    module = importlib.import_module(f"palpate.{folder}")
    assert set(getattr(module, "__all__", ())) <= set(names)


@pytest.mark.parametrize("folder", FOLDERS)
def test_importing_prints_nothing_and_leaves_global_randomness_and_bare_names_alone(folder):
    printed = run_python(
        "import random, sys, numpy as np\n"
        "before = random.getstate(), str(np.random.get_state())\n"
        f"import palpate.{folder}\n"
        "assert (random.getstate(), str(np.random.get_state())) == before\n"
        f"assert not set({FOLDERS!r}) & set(sys.modules)\n"
    )
    assert printed == ""


def test_the_command_line_loads_nothing_heavy_before_a_command_runs():
    run_python(
        "import sys, palpate.scripts.cli\n"
        "heavy = {'numpy', 'scipy', 'mujoco', 'numba', 'trimesh', 'matplotlib', 'gymnasium'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )


@pytest.mark.parametrize(
    ("arguments", "mentions"),
    [
        (["--no-such-flag"], "--no-such-flag"),
        (["no-such-command"], "no-such-command"),
        (["episode", "--seed", "-1"], "--seed"),
    ],
)
def test_a_mistake_on_the_command_line_is_one_line_and_exit_code_2(
    arguments, mentions, monkeypatch, capsys
):
    cli = importlib.import_module("palpate.scripts.cli")
    monkeypatch.setattr(sys, "argv", ["palpate", *arguments])
    with pytest.raises(SystemExit) as exit_:
        cli.main()
    printed = capsys.readouterr()
    assert exit_.value.code == 2
    assert printed.out == ""
    assert printed.err.startswith("palpate: ")
    assert printed.err.count("\n") == 1
    assert mentions in printed.err


@pytest.mark.parametrize(
    ("raised", "code", "printed"),
    [
        (ValueError("row 3: not\na number"), 2, "palpate: row 3: not a number\n"),
        (FileNotFoundError(2, "No such file", "a.csv"), 2, "palpate: a.csv: No such file\n"),
        (KeyboardInterrupt(), 130, "palpate: interrupted\n"),
    ],
)
def test_what_a_command_raises_becomes_one_line_and_an_exit_code(
    raised, code, printed, monkeypatch, capsys
):
    cli = importlib.import_module("palpate.scripts.cli")

    def stumble():
        raise raised

    monkeypatch.setattr(cli.app.registered_commands[0], "callback", stumble)
    monkeypatch.setattr(sys, "argv", ["palpate", cli.app.registered_commands[0].callback.__name__])
    with pytest.raises(SystemExit) as exit_:
        cli.main()
    assert exit_.value.code == code
    assert capsys.readouterr().err.endswith(printed)
