# Every target sets itself up: a fresh machine needs Python >= 3.11 and make, nothing else. The environment lies in
# .venv and is made once; pip's settings (PIP_INDEX_URL, PIP_EXTRA_INDEX_URL, pip.conf) are the caller's.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
PYTEST := $(BIN)/python -m pytest

# A stamp is newer than what it was made from, so a second call installs nothing.
VIZ := $(VENV)/.installed-viz
DEV := $(VENV)/.installed-dev
SB3 := $(VENV)/.installed-sb3
DYNA := $(VENV)/.installed-dyna
DOCS := $(VENV)/.installed-docs

.DEFAULT_GOAL := help
.PHONY: help demo dyna dyna-full plan plan-full reproduce test test-sb3 test-cluster slow slow-sb3 fuzz bench soak outliers coverage lint format types check
.PHONY: wheel docs docs-serve pages animations clean example-highway example-ocatari

help:            ## show this list
	@sed -n 's/^\([a-z0-9-]*\):[^#]*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 17

demo: $(VIZ)     ## learn the laws of both worlds and print them
	$(BIN)/relgym demo

dyna: $(DYNA)    ## agents that train in what they have learned, beside SAC (installs torch)
	$(BIN)/relgym dyna

dyna-full: $(SB3) ## all that dreaming is worth, hours; resumes where it was stopped, writes docs/results/dream.md
	$(BIN)/relgym benchmark dyna --jobs 2 --page docs/results/dream.md

plan: $(VIZ)     ## an agent that explores, prints the laws it found, and plans ten episodes (two minutes)
	$(BIN)/relgym plan

plan-full: $(SB3) ## all that planning is worth, hours; resumes where it was stopped, writes docs/results/plan.md
	$(BIN)/relgym benchmark plan --page docs/results/plan.md

reproduce: $(DEV) ## the thesis' tables and figures again, the fast way; writes docs/results.md
	$(BIN)/relgym reproduce all --batches 2 --fast --page docs/results.md

# Their pins and ours clash (OCAtari wants numpy < 2), so each has a venv of its own. relgym's core runs with both.
example-highway: $(VENV)-highway/.installed ## learn highway-env's traffic from its table of cars
	$(VENV)-highway/bin/python examples/adapters/highway_traffic.py

example-ocatari: $(VENV)-ocatari/.installed ## learn Pong's ball from OCAtari's list of objects
	$(VENV)-ocatari/bin/python examples/adapters/ocatari_pong.py

test: $(DEV)     ## all tests but the slow ones
	$(PYTEST) -n 2

test-sb3: $(SB3) ## the tests that need Stable-Baselines3 (installs torch)
	$(PYTEST) -m "sb3 and not slow"

test-cluster: $(DEV) ## the tests that start clusters (installs dask and ray)
	$(PIP) -e '.[viz,dev,baselines,dask,ray,minari,pettingzoo]'
	$(PYTEST) -m cluster

slow: $(DEV)     ## the tests that take minutes
	$(PYTEST) -m "slow and not sb3 and not cluster"

slow-sb3: $(SB3) ## likewise those that need Stable-Baselines3
	$(PYTEST) -m "slow and sb3"

fuzz: $(DEV)     ## change model files at random for MINUTES (default 10): what is accepted must work
	$(BIN)/python tests/fuzz/run.py --minutes $(or $(MINUTES),10)

bench: $(DEV)    ## the benchmarks
	$(PYTEST) tests/bench -m bench --benchmark-enable --benchmark-only

soak: $(DEV)     ## a million transitions of BallBoxRamp and CartPole: memory, cost and worst step (hours)
	$(BIN)/relgym benchmark soak ball cart
	$(BIN)/relgym benchmark soak lander --steps 100000 --history 20000

outliers: $(DEV) ## what wrong numbers in the stream cost: clean steps predicted with and without them
	$(BIN)/relgym benchmark outliers

coverage: $(DEV) ## which lines the tests never reach
	$(BIN)/coverage run -m pytest
	$(BIN)/coverage report --skip-covered

lint: $(DEV)     ## ruff: rules and format
	$(BIN)/ruff check
	$(BIN)/ruff format --check

format: $(DEV)   ## let ruff fix what it can
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

types: $(DEV)    ## mypy, strict
	$(BIN)/mypy

check: lint types test ## what must pass before every commit

# build/ would hand modules deleted since to the new wheel.
wheel: $(VIZ)    ## build dist/relgym-*.whl
	rm -rf build dist
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .
	rm -rf build

docs: $(DOCS)    ## build the docs site into site/: start with site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	$(BIN)/python docs/tools/check_site.py site

docs-serve: docs ## show it at localhost:8000 (a browser needs that for the site's search)
	$(BIN)/python -m http.server --bind 127.0.0.1 --directory site 8000

pages: $(DEV)    ## run the code on all pages, and write what it prints into them
	$(BIN)/python tests/support/pages.py

animations: $(VIZ) ## draw the envs' moving pictures again
	$(BIN)/python docs/tools/animations.py

clean:           ## remove all that was installed, built and cached
	rm -rf $(VENV) $(VENV)-highway $(VENV)-ocatari build dist site *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks .coverage
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)-highway/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)-highway
	$(VENV)-highway/bin/python -m pip install --quiet --disable-pip-version-check -e . 'highway-env==1.12.1'
	@touch $@

$(VENV)-ocatari/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)-ocatari
	$(VENV)-ocatari/bin/python -m pip install --quiet --disable-pip-version-check 'ocatari==2.2.1' 'ale-py==0.12.1' \
		'gymnasium>=1.2,<2' llvmlite msgspec python-fcl scipy rich typer
	$(VENV)-ocatari/bin/python -m pip install --quiet --disable-pip-version-check --no-deps -e .
	@touch $@

$(VENV)/pyvenv.cfg:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "relgym needs Python >= 3.11, this is %d.%d: make PYTHON=python3.11 ..." % sys.version_info[:2])'
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

$(VIZ): $(VENV)/pyvenv.cfg pyproject.toml constraints.txt
	$(PIP) -e '.[viz]'
	@touch $@

$(DYNA): $(VIZ)
	$(PIP) -e '.[viz,sb3]'
	@touch $@

$(DEV): $(VIZ)
	$(PIP) -e '.[viz,dev,baselines,minari,pettingzoo]'
	@touch $@

$(DOCS): $(VIZ)
	$(PIP) -e '.[viz,docs]'
	@touch $@

$(SB3): $(DEV)
	$(PIP) -e '.[viz,dev,baselines,sb3,minari,pettingzoo]'
	@touch $@
