# `make compare` and `make test` each set up .venv by themselves. Needs make and Python 3.11 or newer.
#
#   PYTHON=python3.12 make test            another interpreter
#   make compare ARGS="--episodes 100"     arguments of studies.compare
#   make test ARGS="-k lander"             arguments of pytest (also for test-all and test-minimum)

PYTHON ?= python3
ARGS ?=
VENV := .venv
BIN := $(VENV)/bin
PIP_INSTALL := $(BIN)/python -m pip --disable-pip-version-check install
MINIMUM := .venv-minimum

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help setup lint test test-all test-minimum compare demo bench results results-check docs clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-13s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(VENV)/.installed-dev  ## create .venv with everything that a developer needs

lint: $(VENV)/.installed-dev  ## ruff, ruff format, pyright, import contracts
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright
	$(BIN)/lint-imports

test: lint  ## lint, then the fast tests
	$(BIN)/pytest -m "not slow and not browser" -n 2 $(ARGS)

test-all: lint  ## lint, then every test
	$(BIN)/pytest -n 2 $(ARGS)

test-minimum: $(MINIMUM)/.installed  ## the fast tests, on the least versions of the libraries
	$(MINIMUM)/bin/pytest -m "not slow and not browser" -n 2 $(ARGS)

compare: $(VENV)/.installed  ## fly every policy on the same episodes and print the table
	$(BIN)/python -m studies.compare --resume $(ARGS)

demo: $(VENV)/.installed  ## a first result: 100 episodes, six policies, and the report on your screen
	$(BIN)/python -m studies.compare --quick $(ARGS)

bench: $(VENV)/.installed  ## measure the speed of the inner loops
	$(BIN)/python -m studies.bench $(ARGS)

results: $(VENV)/.installed  ## make the tables of docs/results again, what is missing first; hours
	$(BIN)/python -m studies.results $(ARGS)

results-check: $(VENV)/.installed-dev  ## compare the smaller tables of docs/results with a fresh run
	$(BIN)/pytest tests/documentation/test_results.py $(ARGS)

docs: $(VENV)/.installed-docs  ## build the documentation into site/; a warning is an error
	$(BIN)/zensical build --strict --clean
	@echo "open site/index.html"

clean:  ## remove .venv, caches and build products; results and the per-user terrain cache stay
	rm -rf $(VENV) $(MINIMUM) build dist site .cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/python:
	@command -v "$(PYTHON)" >/dev/null || { \
	    echo "error: no interpreter named '$(PYTHON)'; install Python 3.11 or newer, or run: make PYTHON=/path/to/python3.11 ..." >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	    echo "error: Python 3.11 or newer is needed, '$(PYTHON)' is $$("$(PYTHON)" --version 2>&1); run: make PYTHON=python3.11 ..." >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || { \
	    echo "error: '$(PYTHON)' cannot make a virtual environment; on Debian or Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	"$(PYTHON)" -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(PIP_INSTALL) -e .
	@touch $@

$(VENV)/.installed-dev: pyproject.toml | $(BIN)/python
	$(PIP_INSTALL) -e '.[dev]'
	@touch $(VENV)/.installed $(VENV)/.installed-docs $@

$(VENV)/.installed-docs: pyproject.toml | $(BIN)/python
	$(PIP_INSTALL) -e '.[docs]'
	@touch $(VENV)/.installed $@

$(MINIMUM)/.installed: pyproject.toml tests/minimum_versions.py
	"$(PYTHON)" -m venv --clear $(MINIMUM)
	$(MINIMUM)/bin/python tests/minimum_versions.py > $(MINIMUM)/minimum.txt
	$(MINIMUM)/bin/python -m pip --disable-pip-version-check install -c $(MINIMUM)/minimum.txt -e '.[dev]'
	@touch $@
