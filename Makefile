# make benchmark   the scripted policies on the papers' protocols, in PyBullet; the table ends up in results/quick/
# make leaderboard every policy on the headline scenarios, under an hour; docs/leaderboard.md and results/report.html
# make test        the tests; what they print ends with the ten that took longest
# make test-portable  those of them that may differ from one Python to another
# make test-slow   those that take more than a few seconds each
# make test-long   those of them that a change does not wait for: 200 fields where a quicker one has 10, other packages
# make mutants     do the tests notice a small mistake in the rules? 300 of them, the better part of an hour
# make media       the documentation's moving pictures, in docs/media
# make lint        ruff and pyright
# make docs        the documentation's site in docs/_build/html; warnings are errors
# make docs REPLAYS=no  the same without the replays, which take minutes
# make docs-serve  the same, served at http://127.0.0.1:8000
# make linkcheck   follow every link within the site, to files and to headings
# make linkcheck-elsewhere  ask every link that leads elsewhere; needs the network
# make pythons     which Pythons this machine has for it, the preferred one first
# make clean       delete what the other targets made, the results and the user's cache folder excepted
#
# Each target first makes the virtual environment that it needs, once. Another place for it, another Python:
#   make test VENV=/tmp/venv PYTHON=python3.13
# Another order of the tests: make test ORDER=anything

VENV ?= .venv
PYTHON ?=
EXTRAS ?= dev
JOBS ?= 2
# Tests run in an order that chance made: files, and the tests of a file. The same word gives the same order again.
ORDER ?= 1
# Machine code of everything, before tests ask for it; PREPARE=true leaves each its own to compile.
PREPARE ?= $(BIN)/fieldgym prepare
# Replays of every environment in the site; no leaves them out.
REPLAYS ?= yes
PORTABLE ?= $$(grep --files-with-matches mark.portable tests/test_*.py)
PYENV_ROOT ?= $(HOME)/.pyenv

# Nothing of an active environment may leak into ours.
unexport PYTHONPATH
unexport PYTHONHOME
unexport VIRTUAL_ENV
unexport CONDA_PREFIX

BIN := $(VENV)/bin
PYTEST = $(BIN)/python -m pytest -n $(JOBS) --dist worksteal --random-order-seed=$(ORDER) --durations=10
SITE := docs/_build/html
SITED := $(VENV)/.fieldgym-docs
INPUTS := pyproject.toml constraints.txt Makefile
CORE := $(VENV)/.fieldgym-core
FULL := $(VENV)/.fieldgym-$(EXTRAS)

.PHONY: benchmark leaderboard test test-portable test-slow test-long mutants media lint docs docs-serve linkcheck linkcheck-elsewhere \
    setup pythons clean
.DEFAULT_GOAL := benchmark

benchmark: $(CORE)
	$(BIN)/fieldgym benchmark --suite quick --out results

leaderboard: $(FULL)
	$(BIN)/fieldgym benchmark --suite full --out results --resume
	$(BIN)/fieldgym report results/full --out results/report.html --leaderboard docs/leaderboard.md
	PYTHONPATH=docs $(BIN)/python -m fieldsite.front_page

test: $(FULL)
	$(PYTEST) -m "not slow"

# What may differ from one Python to another: of the weeders, which have nearly all in common, the laser's is enough.
test-portable: $(FULL)
	$(PYTEST) -m "portable and not slow" -k "not HoeWeeding and not LaserWeedingSpeed and not never_stale" $(PORTABLE)

test-slow: $(FULL)
	$(PYTEST) -m "slow and not long"

test-long: $(FULL)
	$(PYTEST) -m long

# Another sample: make mutants MUTANTS="--sample 600 --seed 1". The survivors once more: make mutants MUTANTS=--again
mutants: $(FULL)
	$(BIN)/python scripts/mutants.py $(MUTANTS)

media: $(FULL)
	$(BIN)/python scripts/moving_pictures.py

lint: $(FULL)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

docs: $(SITED)
	REPLAYS=$(REPLAYS) $(BIN)/python -m sphinx -W --keep-going -b html docs $(SITE)
	@echo "The site: $(SITE)/index.html"

docs-serve: docs
	$(BIN)/python -m http.server --bind 127.0.0.1 --directory $(SITE) 8000

linkcheck: docs
	PYTHONPATH=docs $(BIN)/python -m fieldsite.links $(SITE)

linkcheck-elsewhere: $(SITED)
	$(BIN)/python -m sphinx -b linkcheck docs docs/_build/linkcheck

setup: $(FULL)

$(CORE): $(INPUTS) | $(BIN)/python
	@echo "Installing fieldgym into $(VENV), once"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --upgrade pip
	$(BIN)/python -m pip install --disable-pip-version-check --constraint constraints.txt --editable .
	@# Static tools cannot follow an editable install of this layout, but they can follow a link to the tree.
	@mkdir -p $(VENV)/src && ln -sfn "$(CURDIR)" $(VENV)/src/fieldgym
	@cd $(VENV)/src && pwd > "$$(../bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/fieldgym-src.pth"
	$(PREPARE)
	@touch $@

$(FULL): $(CORE)
	$(BIN)/python -m pip install --disable-pip-version-check --constraint constraints.txt --editable ".[$(EXTRAS)]"
	@touch $@

$(SITED): $(CORE)
	@$(BIN)/python -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "The site needs Python 3.11 or later: make docs VENV=/tmp/venv PYTHON=/path/to/python3.11" >&2; exit 1; }
	$(BIN)/python -m pip install --disable-pip-version-check --constraint constraints.txt --editable ".[docs]"
	@touch $@

# One Python of each version that can make environments, the one that is used first: on the path, or pyenv's.
FIND := for version in 3.11 3.10 3.12 3.13; do \
    for python in python$$version "$(PYENV_ROOT)"/versions/$$version.*/bin/python python3 python; do \
        if "$$python" -c 'import sys, venv, ensurepip; sys.exit("%d.%d" % sys.version_info[:2] != "'$$version'")' \
                >/dev/null 2>&1; then \
            command -v "$$python"; \
            break; \
        fi; \
    done; \
done

pythons:
	@$(FIND)

$(BIN)/python:
	@python=$(if $(PYTHON),"$(PYTHON)","$$($(FIND) | head -n 1)"); \
	if "$$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 10))' >/dev/null 2>&1; then \
	    echo "Making $(VENV) with $$("$$python" --version)"; \
	    exec "$$python" -m venv "$(VENV)"; \
	fi; \
	echo "fieldgym needs Python 3.10 or later with its venv and ensurepip modules," \
	     "and $(if $(PYTHON),$(PYTHON) is not that,none was found)." >&2; \
	echo "Install one (Debian, Ubuntu: apt-get install python3.11-venv) or name one: make PYTHON=/path/to/python3.11" >&2; \
	exit 1

clean:
	rm -rf .venv build dist *.egg-info .pytest_cache .ruff_cache .hypothesis
	rm -rf docs/_build docs/made docs/environments docs/reproduction
	rm -f docs/changelog.md docs/contributing.md docs/security.md
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
