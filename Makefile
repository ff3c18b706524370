# Times are for two quiet cores and include what Numba compiles, but neither set-up nor downloads.
# make setup      create .venv and install what the benchmark needs (half a minute)
# make reproduce  set up, run the paper's closed-loop study, print it beside the paper's figures (2 minutes)
# make smoke      set up with pytest, run a few tests per promise (2 minutes)
# make test       set up with the development tools, run the tests (7 minutes)
# make test-long  run those that take longer, all published streets among them (25 minutes)
# make dist       build the sdist, and the wheel from it, in dist/
# make test-installed   install that wheel in an environment of its own, run the sdist's tests with it
# make test-extras   install that wheel with one extra after the other, each alone, and use it; EXTRAS="viewer video"
# make bench      measure speed beside other engines and environments; ARGS="--seconds 0.3 --repeats 1" is short
# make parity     hold the engine `fast` against Bullet, ray by ray; ARGS="--scenes 1000 --episodes 1" is short
# make publish DATA=FOLDER   play published studies again and replace their rows, the cheapest first; it resumes.
#                 FOLDER holds recordings; ARGS="order ablate" plays these two, ARGS=--list prints order and costs
# make test-speed   hold the ratios of speed to the published ones; nothing else may run meanwhile
# make docs       build the documentation's site into build/site; REPOSITORY_URL=URL adds a link to the repository
# make check      format, lint, types, plain words, tests
# make torture    random input for ten minutes: commands, calls, files, kills, full disks; SECONDS=600 SEED=0
#                 CAMPAIGNS="commands files" CASES=1000 unless all; CASE=NAME plays one case alone
# make official RESULTS=FILE DATA=FOLDER   score a file of `care-sim export` with the nuScenes devkit, which has an
#                 environment of its own; SPLIT=val, VERSION=v1.0-trainval and OUT=FOLDER unless given otherwise
# make official-precision FOLDER=DIR   average precision by the devkit of what `care-sim judge --official` wrote to DIR
# make test-official   test both with the devkit
# The newest Python that has venv; a pyenv of several versions has commands that do not run.
newest = $(shell for python in $(1); do $$python -c "import ensurepip" 2>/dev/null && echo $$python && break; done)
PYTHON ?= $(call newest,python3.13 python3.12 python3.11)
VENV := .venv
BIN := $(VENV)/bin
PIP := python -m pip install --quiet --disable-pip-version-check --constraint
# Bytecode is written on all cores, and not of the libraries' tests: pip takes three times as long. It is written even
# where Python is told to write none, since each of the many processes would compile everything anew.
INSTALL := $(BIN)/$(PIP) constraints.txt --no-compile
COMPILE := $(BIN)/python -m compileall -qq -j 0 -x '/tests?/|/pybullet_' $(VENV)/lib care_sim || true
# worksteal: each process begins with half of the tests, in order. The process that is done first takes over from the
# end of the other's list. Two that begin with the same test would both compile the same.
SPREAD := --numprocesses 2 --dist worksteal
OFFICIAL := .venv-official
INSTALLED := build/installed
SPLIT := val
VERSION := v1.0-trainval
SECONDS := 600
SEED := 0
OUT = $(basename $(RESULTS))-official

ifneq ($(filter official-precision,$(MAKECMDGOALS)),)
  ifneq ($(shell test -f "$(FOLDER)/official/truth.json" || echo no),)
    $(error FOLDER=$(FOLDER) must be one to which care-sim judge --official has written)
  endif
endif
ifneq ($(filter official,$(MAKECMDGOALS)),)
  ifeq ($(and $(RESULTS),$(DATA)),)
    $(error make official needs RESULTS=FILE and DATA=FOLDER)
  endif
  ifneq ($(shell test -f "$(RESULTS)" || echo no),)
    $(error RESULTS=$(RESULTS) is no file; it must be one of care-sim export)
  endif
  ifneq ($(shell test -d "$(DATA)/$(VERSION)" || echo no),)
    $(error DATA=$(DATA) has no folder $(VERSION); it must be the root of nuScenes, VERSION the folder of its tables)
  endif
endif

# Stop in one line before anything is installed.
define python_is_fit
  $(if $(filter yes,$(shell { $(PYTHON) -c $(IS_FIT); } 2>/dev/null)),,$(error CARE-Sim needs Python 3.11, 3.12 or 3.13 with \
    venv (on Debian: apt-get install python3-venv)$(if $(PYTHON),$(comma) which PYTHON=$(PYTHON) is not); choose one by \
    make $(MAKECMDGOALS) PYTHON=PATH))
endef
IS_FIT := "import ensurepip, sys; print('yes' if (3, 11) <= sys.version_info < (3, 14) else 'no')"
comma := ,

.PHONY: setup reproduce smoke test test-long test-installed test-extras bench parity publish test-speed dist check docs lint torture official official-precision test-official clean

setup: $(VENV)/.installed

$(BIN)/pip:
	$(python_is_fit)
	$(PYTHON) -m venv --clear $(VENV)

$(VENV)/.installed: $(BIN)/pip pyproject.toml constraints.txt requirements-pybullet.txt
	$(INSTALL) --no-deps --requirement requirements-pybullet.txt
	$(INSTALL) --editable .
	$(COMPILE)
	touch $@

$(VENV)/.testing: $(VENV)/.installed
	$(INSTALL) --editable .[test]
	$(COMPILE)
	touch $@

$(VENV)/.developing: $(VENV)/.installed
	$(INSTALL) --editable .[dev]
	$(COMPILE)
	touch $@

reproduce: setup
	$(BIN)/care-sim reproduce

# Only the files with such tests: pytest imports what it looks into, and other files need extras.
smoke: $(VENV)/.testing
	$(BIN)/python -m pytest -m smoke $(SPREAD) $(sort $(shell grep -rl "@pytest.mark.smoke" --include=test_*.py tests))

test: $(VENV)/.developing
	$(BIN)/python -m pytest -m "not slow and not speed" $(SPREAD)

test-long: $(VENV)/.developing
	$(BIN)/python -m pytest -m "slow and not speed" $(SPREAD)

# From nothing: setuptools would pack what its last lists of files name.
dist: $(VENV)/.developing
	rm -rf dist build/lib *.egg-info
	$(BIN)/python -c "from setuptools import build_meta; build_meta.build_sdist('dist')" >/dev/null
	$(BIN)/python -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir dist dist/*.tar.gz

# Without its own care_sim the sdist's tests meet the installed one.
test-installed: dist
	rm -rf $(INSTALLED)
	$(PYTHON) -m venv $(INSTALLED)/venv
	$(INSTALLED)/venv/bin/$(PIP) constraints.txt "$$(echo dist/*.whl)[dev]"
	mkdir $(INSTALLED)/sdist
	tar xzf dist/*.tar.gz -C $(INSTALLED)/sdist --strip-components 1
	rm -r $(INSTALLED)/sdist/care_sim
	cd $(INSTALLED)/sdist && ../venv/bin/python -m pytest $(SPREAD)

test-extras: dist
	$(BIN)/python -m tests.extras_alone $$(echo dist/*.whl) constraints.txt $(EXTRAS)

bench parity: $(VENV)/.developing
	$(BIN)/python -m tests.$@ $(ARGS)

publish: $(VENV)/.developing
	$(BIN)/python -m tests.publish $(if $(DATA),--data "$(DATA)") $(ARGS)

test-speed: $(VENV)/.developing
	$(BIN)/python -m pytest -m speed

# NO_MKDOCS_2_WARNING: the theme tells of its end of life, in May 2027, at every build; a warning is to be one of a page.
docs: $(VENV)/.developing
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --config-file .mkdocs.yml
	@echo "build/site/index.html; to search in it: $(BIN)/python -m http.server --directory build/site"

lint: $(VENV)/.developing
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest --quiet tests/repository/test_words.py

check: $(VENV)/.developing
	$(BIN)/ruff format .
	$(MAKE) lint test

torture: $(VENV)/.developing
	$(BIN)/python -m tests.torture $(if $(CASE),--case $(CASE),--seed $(SEED) \
	  $(if $(CASES),--cases $(CASES),--seconds $(SECONDS)) $(if $(CAMPAIGNS),--campaigns $(CAMPAIGNS)))

# The devkit's numpy has no wheels for Python 3.13.
$(OFFICIAL)/.installed: constraints-official.txt
	$(if $(filter file,$(origin PYTHON)),$(call newest,python3.12 python3.11),$(PYTHON)) -m venv --clear $(OFFICIAL)
	$(OFFICIAL)/bin/$(PIP) $< nuscenes-devkit
	touch $@

official: $(OFFICIAL)/.installed
	$(OFFICIAL)/bin/python -m nuscenes.eval.detection.evaluate "$(RESULTS)" --dataroot "$(DATA)" \
	  --eval_set "$(SPLIT)" --version "$(VERSION)" --output_dir "$(OUT)" --plot_examples 0 --render_curves 0

official-precision: $(OFFICIAL)/.installed
	$(OFFICIAL)/bin/python tests/official/average_precision.py "$(FOLDER)/official"

test-official: $(VENV)/.developing $(OFFICIAL)/.installed
	$(BIN)/python -m pytest tests/official -m "not slow and not speed"

clean:
	rm -rf $(VENV) $(OFFICIAL) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
