# Everything a clean clone needs: Python 3.11, make and a package index that pip knows.
PYTHON ?= python3.11
VENV   ?= .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
DATA   := $(or $(AEROCAL_TEST_DATA),../shared/data)
EXAMPLE := examples/ign_ultracam_eagle/project.toml

.PHONY: venv test slow-test lint demo clean

venv: $(STAMP)

# The locks are complete, so pip resolves nothing; the project itself is installed in place.
$(STAMP): requirements.lock requirements-dev.lock pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -r requirements-dev.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

test: $(STAMP)
	$(BIN)/python -m pytest -m "not slow and not service"

slow-test: $(STAMP)
	$(BIN)/python -m pytest -m slow

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

demo: $(STAMP)
	@test -d "$(DATA)" || { echo "The demo needs the real data: set AEROCAL_TEST_DATA to their folder ($(DATA) does not exist)."; exit 2; }
	$(BIN)/aerocal doctor $(EXAMPLE) --data "$(DATA)"
	$(BIN)/aerocal run $(EXAMPLE) --data "$(DATA)" --out results/demo

clean:
	rm -rf results build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
