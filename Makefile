# `make` prints what there is. `make bench` gives a first ranked table, `make test` lint, types and tests.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := samplers renderer metrics experiments
RENDERERS := .venv-renderers

.PHONY: help setup bench test lint types docs site renderers lock clean

help:  ## Print this list
	@awk -F ':.*## +' '/^[a-z]+:.*## /{printf "make %-10s %s\n", $$1, $$2}' Makefile

setup: $(VENV)/.installed  ## Install into .venv: envlight, and what it needs

bench: $(VENV)/.installed  ## Measure the quick run: every sampler, 32 maps, a ranked table
	$(BIN)/envlight run table1 --scale quick --scenes vase --executor processes

test: $(VENV)/.installed-test lint types  ## Lint, check types, run all tests
	$(BIN)/python -m pytest -n 2 --dist worksteal

lint: $(VENV)/.installed-test  ## Check style, and that imports go one way
	$(BIN)/ruff check $(SOURCES) tests examples
	$(BIN)/ruff format --check $(SOURCES) tests examples
	PYTHONPATH=. $(BIN)/lint-imports

types: $(VENV)/.installed-test  ## Check types
	$(BIN)/mypy

docs: $(VENV)/.installed-docs  ## Write pages about every public name: api/index.html
	rm -rf api
	$(BIN)/python -m experiments.cli.api_pages api

site: $(VENV)/.installed  ## Write pages of everything in results/: site/index.html
	$(BIN)/envlight site results site --runs runs

# 1.6 GB, in an environment of their own. Blender's package is made for Python 3.11 alone.
RENDERERS_PYTHON ?= python3.11

renderers: $(RENDERERS)/.installed  ## Install Mitsuba 3, Blender and LuxCore for production-renderers

lock:  ## Renew constraints.txt from the ranges of pyproject.toml
	$(PYTHON) -m venv $(VENV)-lock
	$(VENV)-lock/bin/python -m pip install --quiet --disable-pip-version-check -e '.[test,peer,cluster,usd,docs]'
	$(VENV)-lock/bin/python -m pip freeze --exclude-editable --exclude envlight > constraints.txt
	rm -rf $(VENV)-lock

clean:  ## Remove what is made here, but results/
	rm -rf $(VENV) $(RENDERERS) runs site api *.egg-info .pytest_cache .mypy_cache .ruff_cache

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "Python 3.11 or newer is needed; set PYTHON=python3.x")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

$(VENV)/.installed-test: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,peer,cluster,usd,docs]'
	@touch $@ $(VENV)/.installed

$(VENV)/.installed-docs: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	@touch $@ $(VENV)/.installed

$(RENDERERS)/.installed: pyproject.toml
	test -x $(RENDERERS)/bin/python || $(RENDERERS_PYTHON) -m venv $(RENDERERS)
	$(RENDERERS_PYTHON) -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["renderers"], sep="\n")' > $(RENDERERS)/requirements.txt
	$(RENDERERS)/bin/python -m pip install --quiet --disable-pip-version-check -r $(RENDERERS)/requirements.txt
	@touch $@
