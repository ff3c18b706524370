# make setup      create .venv and install what the benchmark needs
# make reproduce  set up, run the paper's closed-loop study, print it beside the paper's figures
# make test       set up with the development tools, run every test
# make check      format, lint, types, tests
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

.PHONY: setup reproduce test check lint clean

setup: $(VENV)/.installed

$(BIN)/pip:
	$(PYTHON) -m venv --clear $(VENV)

$(VENV)/.installed: $(BIN)/pip pyproject.toml constraints.txt
	$(INSTALL) --editable .
	touch $@

$(VENV)/.developing: $(VENV)/.installed
	$(INSTALL) --editable .[dev]
	touch $@

reproduce: setup
	$(BIN)/care-sim reproduce

test: $(VENV)/.developing
	$(BIN)/python -m pytest --numprocesses 2

lint: $(VENV)/.developing
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

check: $(VENV)/.developing
	$(BIN)/ruff format .
	$(MAKE) lint test

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
