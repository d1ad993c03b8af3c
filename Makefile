# make demo    set up and run the main job on an example: a plan and its validation
# make check   set up and run formatter check, linter, strict types and tests
# make benchmarks    measure against peers, side by side
# make lock    renew requirements.lock
# make clean   remove the virtual environment and caches

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
DEMO   ?= examples/scenarios/paper-grid-same.yaml

export PIP_DISABLE_PIP_VERSION_CHECK = 1

.PHONY: demo check benchmarks lock clean

demo: $(VENV)/.run
	$(BIN)/syncplan plan $(DEMO) --format table
	$(BIN)/syncplan validate $(DEMO) --trials 200 --seed 1 --format table

check: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest

benchmarks: $(VENV)/.dev
	$(BIN)/pip install --quiet --constraint requirements.lock --editable '.[bench]'
	$(BIN)/python -m benchmarks

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "syncplan needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.run: $(BIN)/python pyproject.toml requirements.lock
	$(BIN)/pip install --quiet --constraint requirements.lock --editable .
	touch $@

$(VENV)/.dev: $(BIN)/python pyproject.toml requirements.lock
	$(BIN)/pip install --quiet --constraint requirements.lock --editable '.[dev]'
	touch $@ $(VENV)/.run

lock: $(BIN)/python
	$(BIN)/pip install --quiet 'uv>=0.9,<1'
	$(BIN)/uv pip compile --quiet --no-header --no-annotate --no-emit-index-url --no-emit-find-links --all-extras \
		--python-version 3.11 --output-file requirements.lock pyproject.toml

clean:
	rm -rf $(VENV) .mypy_cache .pytest_cache .ruff_cache .hypothesis .schemathesis build dist
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
