# Everything runs from .venv, which is made on first use and brought up to date when
# pyproject.toml or constraints.txt change. Only python3 with venv and pip is needed.

PYTHON ?= python3

VENV := .venv
BIN := $(VENV)/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
FRAME := pyproject.toml constraints.txt hatch_build.py $(wildcard */assets/manifest.toml)
RUNTIME := $(VENV)/.runtime
DEV := $(VENV)/.dev
BIOME := @biomejs/biome@2.6.8

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help demo test lint bench accuracy views bayes chances reproduce golden soak walks docs pictures plugin clean

help: ## show this list
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 14

demo: $(RUNTIME) ## the embedded city end to end, into demo/: database, evaluation, map, GeoPackage
	$(BIN)/semsig demo --out demo

test: $(DEV) ## the whole test suite on all processors, with coverage
	$(BIN)/python -m pytest -n auto --dist loadfile --cov --cov-report=term:skip-covered

lint: $(DEV) ## style, types, import layers, docstrings, browser code
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/numpydoc lint $$(find semsig_gis -name '*.py')
	@if command -v npx >/dev/null; then \
		echo 'npx $(BIOME) lint'; \
		npx --yes --prefer-offline $(BIOME) lint --error-on-warnings; \
	else \
		echo 'There is no npx on this machine, so the browser code was not checked.'; \
		case "$${CI:+browser},$$SEMSIG_REQUIRE" in *browser*) exit 1 ;; esac; \
	fi

bench: $(DEV) ## the benchmarks
	$(BIN)/python -m benchmarks
	$(BIN)/python -m benchmarks.tables

accuracy: $(DEV) ## how well the methods localize: figures, an hour
	$(BIN)/python -m benchmarks.accuracy
	$(BIN)/python -m benchmarks.tables

views: $(DEV) ## how well photos localize, with sectors and rough ranges: figures, hours
	$(BIN)/python -m benchmarks.views
	$(BIN)/python -m benchmarks.tables

bayes: $(DEV) ## what no method can pass, by exact sums in a small city: figures, half an hour
	$(BIN)/python -m benchmarks.bayes
	$(BIN)/python -m benchmarks.tables

chances: $(DEV) ## whether stated chances come true, on old maps too: figures, an hour
	$(BIN)/python -m benchmarks.chances
	$(BIN)/python -m benchmarks.tables

reproduce: $(DEV) ## the paper's experiments, into reproduction/: report and figures, a quarter of an hour
	$(BIN)/semsig reproduce --out reproduction --json > reproduction.json
	mv reproduction.json benchmarks/reproduction.json
	$(BIN)/python -m benchmarks.tables

docs: $(DEV) ## the documentation, into docs/_build/html
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html

golden: $(DEV) ## what must not change, into golden/: outputs and files of all commands
	$(BIN)/python -m benchmarks.golden golden

soak: $(DEV) ## kill, starve and damage everything, some thousand times: half an hour
	$(BIN)/python -m benchmarks.soak
	$(BIN)/python -m benchmarks.tables

walks: $(DEV) ## the functions and modules that a row of trees and a query cross
	$(BIN)/python -m benchmarks.walks

pictures: $(DEV) ## every kind of map in a browser, light and dark, desk and phone: pictures to look at
	$(BIN)/python -m benchmarks.pictures

plugin: ## the QGIS plugin, into dist/: a zip file to install
	$(PYTHON) qgis_plugin/package.py dist

clean: ## remove .venv and everything that the targets write
	rm -rf $(VENV) demo golden pictures reproduction reproduction.json build dist docs/_build docs/generated htmlcov .coverage .coverage.* \
		.hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The demonstration needs no tools, so it has a smaller set-up of its own.
$(RUNTIME): $(FRAME) | $(BIN)/python
	$(INSTALL) -e .
	@touch $@

$(DEV): $(FRAME) | $(BIN)/python
	$(INSTALL) -e '.[dev]'
	@touch $(RUNTIME) $@

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
