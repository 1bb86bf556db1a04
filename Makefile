# All work happens in a virtual environment of its own: nothing has to be installed or activated first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEMO := .demo
# a process for each core, and all tests of a file in one of them, for they share photos; threads of small matrix products would only wait for each other
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist loadfile
PHOTOS ?= samples/hall samples/poster

.DEFAULT_GOAL := help
.PHONY: help demo setup check test test-all bench laboratory samples docs clean

help: ## this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

$(VENV)/base: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

$(VENV)/dev: $(VENV)/base
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@

setup: $(VENV)/dev ## virtual environment with the program and the tools of development

demo: $(VENV)/base ## stitch a sample; says where the panorama and the debug pictures lie
	@mkdir -p $(DEMO)
	$(BIN)/panostitch samples/hall -o $(DEMO)/hall.jpg --debug-dir $(DEMO)/hall-stages --overwrite
	@echo "panorama:       $(CURDIR)/$(DEMO)/hall.jpg"
	@echo "debug pictures: $(CURDIR)/$(DEMO)/hall-stages"

check: $(VENV)/dev ## format, lint, types, import contract, reference pages
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python docs/make_reference.py --check

test: $(VENV)/dev ## the tests that take minutes, not hours
	$(PYTEST)

test-all: $(VENV)/dev ## all tests
	$(PYTEST) -m ''

bench: $(VENV)/dev ## error and seconds; accuracy goes into docs/reference; seconds of PHOTOS="FOLDER ..." or the samples
	$(BIN)/python benchmarks/accuracy.py --output docs/reference/accuracy.md
	$(BIN)/python benchmarks/causes.py --output docs/reference/causes.md
	$(BIN)/python benchmarks/bundle.py --quick
	$(BIN)/python benchmarks/registration_time.py $(PHOTOS)

laboratory: $(VENV)/dev ## measure what textbooks claim, again; into docs/explanation/laboratory; takes ten minutes
	$(BIN)/python benchmarks/laboratory/run.py

samples: $(VENV)/dev ## photograph the samples again
	$(BIN)/python samples/make_samples.py

docs: $(VENV)/dev ## write the reference of options and exit codes and the pictures of the stages anew
	$(BIN)/python docs/make_reference.py
	$(BIN)/python docs/make_pictures.py

clean: ## remove what was built, never what was written
	rm -rf $(VENV) $(DEMO) build dist .pytest_cache .ruff_cache .mypy_cache .import_linter_cache
