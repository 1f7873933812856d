# make run    start the app on http://localhost:$(PORT)
# make test   run lint, type checks and the whole test suite
# make docs   build the pages of docs/ as HTML in docs/_build
# make pictures retake the README's pictures from the app
# make bench  measure every speed and accuracy table against the peers
# make setup  set up only; the other targets call it

PYTHON ?= python3
PORT ?= 8501
VENV := .venv
BIN := $(VENV)/bin
LOOPS := $(shell grep -rlE --include='*.py' '^(from|import) .*(numba|llvmlite|compilation)' stereolag) \
  stereolag/warming.py

MEASURING := annotated-types lazy-loader numba numpy opencv-python-headless pydantic scipy
# Modules are compiled when they are first imported; most of the packages' never are.
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile

.PHONY: installed run setup setup-dev test check types collected bench docs pictures clean

run: setup
	@exec $(BIN)/python -P stereolag/commands/serving.py --port $(PORT)

# Loops are compiled while the packages that only the app and files need are installed.
setup:
	@$(MAKE) --no-print-directory --jobs=3 installed

installed: $(VENV)/.loops-warm $(VENV)/.app-imported $(VENV)/.command-ready

setup-dev: setup $(VENV)/.dev-ready $(VENV)/.all-loops-warm node_modules/.ready

test: check
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder

# Tests are compiled while types are checked: otherwise each process of the suite would compile all of them.
check: setup-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@$(MAKE) --no-print-directory --jobs=2 types collected
	$(BIN)/node node_modules/typescript/bin/tsc
	$(BIN)/node --test --test-reporter=dot tests/web/*.test.js

types:
	$(BIN)/mypy

collected:
	@found=$$($(BIN)/python -m pytest --collect-only -qqq) || { echo "$$found"; exit 1; }

bench: setup-dev
	$(BIN)/python -m benchmarks

docs: setup-dev
	rm -rf docs/generated
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --jobs auto --quiet docs docs/_build

pictures: setup-dev
	$(BIN)/python -m tools.screenshots

clean:
	rm -rf docs/_build docs/generated node_modules $(VENV) .pytest_cache .mypy_cache .ruff_cache

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(v < (3, 11) and f"stereolag needs Python 3.11 or newer; {sys.executable} is {v.major}.{v.minor}. Name another: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.measuring-ready: requirements.txt | $(VENV)/bin/python
	$(INSTALL) --constraint requirements.txt $(MEASURING)
	@touch $@

$(VENV)/.run-ready: requirements.txt $(VENV)/.measuring-ready
	$(INSTALL) -r requirements.txt
	@touch $@

# The first import compiles, so it comes while loops are compiled rather than before the first page.
$(VENV)/.app-imported: $(VENV)/.run-ready
	@$(BIN)/python -c 'import pandas, plotly.graph_objects, streamlit.web.bootstrap'
	@touch $@

# The command `stereolag`, which runs this checkout.
$(VENV)/.command-ready: pyproject.toml | $(VENV)/.run-ready
	$(INSTALL) --no-deps --editable .
	@touch $@

$(VENV)/.dev-ready: requirements-dev.txt requirements.txt | $(VENV)/bin/python
	$(INSTALL) -r requirements-dev.txt
	@touch $@

# Node comes with requirements-dev.txt; npm installs TypeScript alone, which checks the scripts of the pages.
node_modules/.ready: package.json package-lock.json $(VENV)/.dev-ready
	$(BIN)/npm ci --silent
	@touch $@

# Compiling once here spares the app's first visitor the wait: the machine code is kept on disk. The app compiles the
# loops that no page runs as it opens, in the background.
$(VENV)/.loops-warm: $(VENV)/.measuring-ready $(LOOPS)
	$(BIN)/python -m stereolag.warming pages
	@touch $@

$(VENV)/.all-loops-warm: $(VENV)/.loops-warm
	$(BIN)/python -m stereolag.warming
	@touch $@
