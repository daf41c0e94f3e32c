"""What is installed is what lies here, and data flows one way.

The folders at the top of the repository are installed as ``palpate.<folder>``: an arrangement with
one trap (a new folder works from a checkout and is missing in a wheel), which these tests close.
Imports are walked down to the single module, those within functions and those for types too.
"""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import subprocess
import sys
import tomllib
from collections import Counter
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
ROOMS = {
    "recognizer": (
        *("models", "contacts", "tables", "tree"),
        *("poses.motions", "poses.fits"),
        *("beliefs", "predict", "advice"),
    ),
    "envs": ("collision", "scene", "sensors", "pictures", "planar"),
    "policies": ("outcomes",),
    "scripts": (
        *("benchmark", "report", "page"),
        *("memo", "memo.errors", "memo.bounds", "memo.range", "commands", "lab"),
    ),
}
"""Rooms of each folder in the order in which data flows: each imports those before it at most."""
NOT_INSTALLED = ROOT / "scripts" / "lab"
MOST_MODULES, MOST_LINES = 25, 350
RECOGNIZER_STANDS_ON = {
    *("numpy", "scipy", "trimesh", "platformdirs"),
    *("numba", "llvmlite"),  # one comes with the other
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


def installed_modules() -> dict[str, Path]:
    """Every module of the five folders by its import name, a package by that of its folder."""
    found = [path for folder in FOLDERS for path in modules_of(folder)]
    return {import_name(path).removesuffix(".__init__"): path for path in found}


def edges_between(modules: dict[str, Path]) -> dict[str, set[str]]:
    """Which module imports which."""
    edges: dict[str, set[str]] = {}
    for name, path in modules.items():
        inside = f"{name}.__init__" if path.stem == "__init__" else name
        found = {
            _module_of(target, modules)
            for target in imports_of(path.read_text(encoding="utf-8"), inside)
        }
        edges[name] = {target for target in found if target not in (None, name)}
    return edges


def _module_of(name: str, modules: dict[str, Path]) -> str | None:
    while name and name not in modules:
        name = name.rpartition(".")[0]
    return name or None


def circles(edges: dict[str, set[str]]) -> list[list[str]]:
    """What leads back to itself, by taking away whatever imports nothing that is left."""
    left = {name: set(targets) for name, targets in edges.items()}
    while ends := {name for name, targets in left.items() if not targets & set(left)}:
        left = {name: targets for name, targets in left.items() if name not in ends}
    return [sorted(left)] if left else []


def room_of(module: str) -> str:
    """The innermost room that a module is in; a module in none is one of its own."""
    _, folder, *rest = module.split(".")
    rooms = sorted(ROOMS.get(folder, ()), key=len, reverse=True)
    inside = ".".join(rest)
    found = [room for room in rooms if inside == room or inside.startswith(f"{room}.")]
    return f"palpate.{folder}.{found[0]}" if found else module


def test_no_import_leads_back_to_its_module():
    assert circles(edges_between(installed_modules())) == []


def test_no_import_leads_back_to_its_room():
    rooms: dict[str, set[str]] = {}
    for module, targets in edges_between(installed_modules()).items():
        room = room_of(module)
        rooms.setdefault(room, set()).update({room_of(target) for target in targets} - {room})
    assert circles(rooms) == []


def test_every_room_imports_only_rooms_before_it():
    found = []
    for module, targets in edges_between(installed_modules()).items():
        folder = module.split(".")[1]
        order = [f"palpate.{folder}.{room}" for room in ROOMS.get(folder, ())]
        for target in targets:
            here, there = room_of(module), room_of(target)
            if here in order and there in order and order.index(there) > order.index(here):
                found.append(f"{module} imports {target}")
    assert found == []


def test_a_circle_is_noticed():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": set()}) == [["a", "b", "c"]]
    assert circles({"a": {"b"}, "b": {"c"}, "c": set()}) == []


def test_every_subfolder_is_a_room():
    for folder, rooms in ROOMS.items():
        inside = {import_name(path.parent) for path in modules_of(folder)} - {f"palpate.{folder}"}
        named = {f"palpate.{folder}.{room}" for room in rooms}
        outer = {f"palpate.{folder}.{room.rpartition('.')[0]}" for room in rooms if "." in room}
        assert {name for name in inside if not name.startswith("palpate.scripts.lab.")} == (
            named | outer
        )


def test_no_folder_has_to_be_searched_and_no_module_is_two():
    modules = [path for folder in FOLDERS for path in modules_of(folder)]
    folders = Counter(path.parent for path in modules if path.stem != "__init__")
    assert {str(path): n for path, n in folders.items() if n > MOST_MODULES} == {}
    lines = {str(path): len(path.read_text(encoding="utf-8").splitlines()) for path in modules}
    assert {path: count for path, count in lines.items() if count > MOST_LINES} == {}


def test_a_kernel_calls_kernels_alone():
    # What makes compiled code stale is the text of kernels, see `kernel_store`.
    edges = edges_between(installed_modules())
    allowed = "palpate.recognizer.compiling"
    found = [
        f"{module} imports {target}"
        for module, targets in edges.items()
        if module.endswith("_kernels")
        for target in targets
        if not target.endswith("_kernels") and target != allowed
    ]
    assert found == []


def test_every_folder_of_code_or_data_is_installed():
    on_disk = {
        path.parent
        for folder in FOLDERS
        for path in files_of(folder)
        if not path.is_relative_to(NOT_INSTALLED)
    }
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


def test_nothing_that_is_installed_imports_the_lab():
    found = [
        f"{module} imports {target}"
        for module, targets in edges_between(installed_modules()).items()
        for target in targets
        if ".lab" in target and ".lab" not in module
    ]
    assert found == []


PUBLIC = {
    "recognizer": """ANYTHING EDGE FACE VERTEX Belief Constraints ContactKind Contacts FeltFile
        Finding FreeSpace Hypothesis PairTables Polygon Polyhedron PoseDifference PoseSamples
        PoseTolerance Predictions ProbeSpace Recognizer Search SearchLimits SupportPlane TriadRays
        diagnose load_folder pose_difference predict read_contacts sample_belief""",
    "envs": "ENV_ID FINGER_ENV_ID PLANAR_ENV_ID REST_ENV_ID",
    "policies": """GOALS POLICY_NAMES DecisionRegion Goal Grid Information Lookahead Minimax Pairs
        Policy Pruning RandomHit RandomProbe Rate Refine SafeRegion Separation Task make_policy""",
    "assets": "STAND_IN_NAMES ConvexPart load_parts mesh_path parts_path",
}


@pytest.mark.parametrize("folder", PUBLIC)
def test_what_users_import_is_there(folder):
    module = importlib.import_module(f"palpate.{folder}")
    assert [name for name in PUBLIC[folder].split() if not hasattr(module, name)] == []
    assert set(PUBLIC[folder].split()) == set(getattr(module, "__all__", PUBLIC[folder].split()))


@pytest.mark.parametrize(
    "name",
    [
        "palpate.envs.probe_env:ProbeEnv",
        "palpate.policies.session:Session",
        "palpate.scripts.cli:main",
        "palpate.assets.memo:__doc__",
    ],
)
def test_documented_places_hold(name):
    module, _, attribute = name.partition(":")
    assert hasattr(importlib.import_module(module), attribute)


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
        ("palpate.recognizer.tree.tree", "def f():\n    from ...assets import mesh_path"),
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
