# Everything runs from .venv, which is made on first use and updated when
# pyproject.toml or constraints.txt change. Only python3 with venv and pip is needed.

PYTHON ?= python3
# If this is set, as in containers, every process compiles all modules again.
export PYTHONDONTWRITEBYTECODE :=

VENV := .venv
BIN := $(VENV)/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
FRAME := pyproject.toml constraints.txt hatch_build.py $(wildcard */assets/manifest.toml)
RUNTIME := $(VENV)/.runtime
DEV := $(VENV)/.dev
RELEASE := $(VENV)/.release
TESTS := $(BIN)/python -m pytest -n auto --dist worksteal
NOX := PATH="$$(printf '%s:' $$HOME/.pyenv/versions/*/bin)$$PATH:$(abspath $(BIN))" $(BIN)/nox -s
BIOME := @biomejs/biome@2.6.8

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help demo test coverage busy test-all pythons oldest size lint bench accuracy views bayes chances see-more photographs reproduce golden soak stranger walks docs pictures plugin dist clean

help: ## show this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 18

demo: $(RUNTIME) ## a made-up town with all steps, into demo/: maps, report, database, GeoPackage
	$(BIN)/semsig demo --out demo

test: $(DEV) ## the whole test suite on all processors
	$(TESTS)

coverage: $(DEV) ## the same, and check that it runs enough of the lines
	$(TESTS) --cov --cov-report=term:skip-covered

busy: $(DEV) ## the same while six processes are busy, because no test depends on time
	$(BIN)/python -m benchmarks.busy $(TESTS)

test-all: $(DEV) ## test the installed package: Pythons, dependencies, archives; half an hour
	$(NOX) matrix

pythons: $(DEV) ## a few tests of the installed package, on every Python of this machine
	$(NOX) matrix -k 'wheel and newest' -- tests/storage

oldest: $(DEV) ## the oldest versions for test-all, into constraints-oldest.txt
	$(NOX) oldest

size: ## the megabytes and seconds that the plain installation takes
	$(PYTHON) -m benchmarks.installed

lint: $(DEV) ## style, types, import layers, dead code, spelling, dependencies, browser code
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/numpydoc lint $$(find semsig_gis -name '*.py')
	$(BIN)/vulture
	$(BIN)/codespell
	.ci/words/check $(BIN)
	$(BIN)/deptry semsig_gis
	$(BIN)/check-jsonschema --builtin-schema vendor.github-issue-forms .github/ISSUE_TEMPLATE/[!c]*.yml
	$(BIN)/check-jsonschema --builtin-schema vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
	.ci/audit $(BIN)/python constraints.txt
	$(BIN)/bandit --quiet --recursive qgis_plugin/semsig
	$(BIN)/flake8 --max-line-length 120 qgis_plugin/semsig
	$(BIN)/check-jsonschema --builtin-schema vendor.citation-file-format CITATION.cff
	$(BIN)/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*
	$(BIN)/zizmor --quiet --offline --min-confidence medium .github/workflows
	$(BIN)/hadolint Dockerfile
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
	$(BIN)/python -m benchmarks.history

accuracy: $(DEV) ## how well the methods localize: figures, an hour
	$(BIN)/python -m benchmarks.accuracy
	$(BIN)/python -m benchmarks.tables

views: $(DEV) ## how well photos localize, with sectors and rough ranges: figures, hours
	$(BIN)/python -m benchmarks.views
	$(BIN)/python -m benchmarks.tables

bayes: $(DEV) ## upper bound for all methods, by exact sums in a small city: figures, half an hour
	$(BIN)/python -m benchmarks.bayes
	$(BIN)/python -m benchmarks.tables

chances: $(DEV) ## whether stated chances come true, on old maps too: figures, an hour
	$(BIN)/python -m benchmarks.chances
	$(BIN)/python -m benchmarks.tables

see-more: $(DEV) ## what more kinds of things on the map are worth: figures, hours
	$(BIN)/python -m benchmarks.see_more
	$(BIN)/python -m benchmarks.tables

photographs: $(DEV) ## methods on the real photographs in SEMSIG_GEODATA: figures, half an hour
	$(BIN)/semsig benchmark flatlandia $(SEMSIG_GEODATA)/flatlandia --methods paper,default,generic,learned --out benchmarks/real_photographs.json
	$(BIN)/python -m benchmarks.tables

reproduce: $(DEV) ## the paper's experiments, into reproduction/: report and figures, a quarter of an hour
	$(BIN)/semsig reproduce --out reproduction --json > reproduction.json
	mv reproduction.json benchmarks/reproduction.json
	$(BIN)/python -m benchmarks.tables

docs: $(DEV) ## the site, into docs/_build/html, with all its examples run; then its checks
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html
	SEMSIG_SITE=docs/_build/html $(BIN)/python -m pytest -q tests/project/test_site.py

golden: $(DEV) ## outputs and files of all commands, to compare before and after a change, into golden/
	$(BIN)/python -m benchmarks.golden golden

soak: $(DEV) ## kill, interrupt and damage runs, some thousand times: half an hour
	$(BIN)/python -m benchmarks.soak
	$(BIN)/python -m benchmarks.tables

stranger: $(DEV) ## the commands of the README on a bare machine, from clone to map, timed
	$(BIN)/python -m benchmarks.stranger

walks: $(DEV) ## the functions and modules that a row of trees and a query cross
	$(BIN)/python -m benchmarks.walks

pictures: $(DEV) ## screenshots of every kind of map, light and dark, desktop and phone
	$(BIN)/python -m benchmarks.pictures

plugin: $(RELEASE) ## the QGIS plugin, into dist/: a zip file to install
	$(BIN)/python qgis_plugin/package.py dist $(if $(SEMSIG_EMAIL),--email $(SEMSIG_EMAIL))

dist: $(RELEASE) ## a release, into dist/: built twice, checked, installed offline, with its hashes
	.ci/dist $(BIN)

clean: ## remove .venv and everything that the targets write
	rm -rf $(VENV) demo golden pictures reproduction reproduction.json build dist docs/_build docs/api docs/commands docs/notebooks htmlcov .coverage .coverage.* \
		.hypothesis .import_linter_cache .nox .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The demonstration needs no development tools, so it has a smaller set-up.
$(RUNTIME): $(FRAME) | $(BIN)/python
	$(INSTALL) -e '.[plot]'
	@touch $@

$(DEV): $(FRAME) | $(BIN)/python
	$(INSTALL) -e '.[dev]'
	@touch $(RUNTIME) $@

$(RELEASE): $(FRAME) | $(BIN)/python
	$(INSTALL) -e '.[release]'
	@touch $(RUNTIME) $@

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
