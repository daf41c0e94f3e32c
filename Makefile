# `make` lists the targets. Works with GNU make from 3.81 on, on Linux and macOS.
#
# Two stamps remember what is installed in .venv: one for what palpate needs to run, one for what
# its tests and checks need as well. Both follow pyproject.toml. A stamp is the last thing that a
# set-up writes, so a set-up that failed is done again.

PYTHON ?= python3
ARGS ?=

VENV := .venv
BIN := $(VENV)/bin
CREATED := $(VENV)/.created
RUNTIME := $(VENV)/.runtime-installed
DEV := $(VENV)/.dev-installed
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help run test check check-versions format format-check lint wheel types smoke compiled \
    bench bench-touch soundness soak assets clean

help:
	@echo "palpate: recognise polyhedra by touch"
	@echo
	@echo "  make run          play one probing episode (sets up .venv the first time)"
	@echo "  make test         run the tests"
	@echo "  make check        format, lint, types, and the wheel tried outside the repository"
	@echo "  make check-versions"
	@echo "                    the tests on the oldest and newest Python, and on what palpate needs at least"
	@echo "  make bench        measure the recogniser's speed and accuracy"
	@echo "  make bench-touch  measure how exactly the sensors touch, and how fast"
	@echo "  make soundness    try 20,000 random cases and more: is the true pose ever lost?"
	@echo "  make soak         take thousands of random and extreme steps in each environment"
	@echo "  make format       format the code and repair what lint can repair"
	@echo "  make assets       rebuild the object library"
	@echo "  make clean        remove .venv and everything built"
	@echo
	@echo "  ARGS='...'         is handed on, as in: make run ARGS='--object stapler --seed 7'"
	@echo "  PYTHON=python3.12  chooses the Python that .venv is made with (3.11 or newer)"

run: $(RUNTIME) compiled
	@$(BIN)/palpate episode $(ARGS)

test: $(DEV) compiled
	@$(BIN)/pytest -n auto --maxprocesses 8 -m "not slow" $(ARGS)

check: format-check lint wheel types smoke
	@echo "check: everything is in order"

# What it runs on is told in pyproject.toml, [tool.tox]; a Python that isn't there is left out.
check-versions: $(DEV)
	@$(BIN)/tox run $(ARGS)

format-check: $(DEV)
	@echo "check: format"
	@$(BIN)/ruff format --check --quiet . || { $(BIN)/ruff format --check .; \
	    echo "'make format' repairs this" >&2; exit 1; }

lint: $(DEV)
	@echo "check: lint"
	@$(BIN)/ruff check --quiet .

# Built through the sdist, so that a file the sdist forgets is missed here and not by a user, and
# in an emptied build/, because setuptools would put a deleted module's old copy into the wheel.
wheel: $(DEV)
	@echo "check: wheel builds"
	@rm -rf build
	@mkdir -p build
	@$(BIN)/pyproject-build --outdir build/dist . >build/wheel.log 2>&1 || { cat build/wheel.log; exit 1; }

# pyright finds `palpate.…` in an unpacked wheel, as no folder here has that name, and the lab, which
# is in no wheel, beside it.
types: wheel
	@echo "check: types"
	@$(PIP) install --no-deps --target build/types build/dist/*.whl
	@cp -R scripts/lab build/types/palpate/scripts/lab
	@PYRIGHT_PYTHON_IGNORE_WARNINGS=1 $(BIN)/pyright --pythonpath $(BIN)/python --warnings

smoke: wheel
	@echo "check: the wheel runs in a clean environment (downloads what palpate needs)"
	@wheel=$$(ls "$$PWD"/build/dist/*.whl) && away=$$(mktemp -d) && trap 'rm -rf "$$away"' EXIT && \
	$(BIN)/python -m venv "$$away/venv" && \
	"$$away/venv/bin/python" -m pip --quiet --disable-pip-version-check install "$$wheel" && \
	cd "$$away" && venv/bin/palpate --version && venv/bin/palpate episode --seed 1 --picture out.png && \
	test -s out.png

bench: $(DEV) compiled
	@$(BIN)/python -m palpate.scripts.lab.bench $(ARGS)

bench-touch: $(DEV) compiled
	@$(BIN)/python -m palpate.scripts.lab.bench.touch $(ARGS)

soundness: $(DEV) compiled
	@$(BIN)/python -m palpate.scripts.lab.soundness $(ARGS)
	@$(BIN)/pytest -n auto --maxprocesses 8 -m slow

soak: $(DEV) compiled
	@$(BIN)/python -m palpate.scripts.lab.soak $(ARGS)

format: $(DEV)
	@$(BIN)/ruff check --fix --quiet . || true
	@$(BIN)/ruff format .

assets: $(DEV)
	@$(BIN)/python -m palpate.assets.build $(ARGS)

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .ruff_cache .hypothesis
	find assets envs policies recognizer scripts tests -name __pycache__ -type d -prune -exec rm -rf {} +

$(CREATED):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	    echo "palpate needs Python 3.11 or newer, and '$(PYTHON)' is" \
	        "$$($(PYTHON) --version 2>/dev/null || echo 'not found')." \
	        "Name another: make PYTHON=python3.12 run" >&2; exit 1; }
	@echo "set-up: making $(VENV) with $$($(PYTHON) --version)"
	@$(PYTHON) -m venv --clear $(VENV) || { \
	    echo "$(PYTHON) could not make a virtual environment (on Debian: apt install python3-venv)" >&2; \
	    exit 1; }
	@touch $@

$(RUNTIME): pyproject.toml $(CREATED)
	@echo "set-up: installing palpate and what it runs on (once; a minute or two)"
	@$(PIP) install --editable .
	@touch $@

$(DEV): pyproject.toml $(CREATED)
	@echo "set-up: installing palpate and the tools of its tests and checks (once; some minutes)"
	@$(PIP) install --editable '.[dev]'
	@touch $(RUNTIME) $@

# Compiled once, here, so that neither the first episode nor the first test waits for it. Whether
# that has been done, and for which kernels, palpate knows itself.
compiled: $(RUNTIME)
	@$(BIN)/palpate prepare >/dev/null
