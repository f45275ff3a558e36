# Everything a clean clone needs: Python 3.11, make and a package index that pip knows.
PYTHON ?= python3.11
VENV   ?= .venv
# More options for pytest.
OPTIONS ?=
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
BENCH_STAMP := $(VENV)/.installed-bench
DEPLOY_VENV := $(VENV)-deploy
DEPLOY_STAMP := $(DEPLOY_VENV)/.installed
DOCS_VENV := $(VENV)-docs
DOCS_STAMP := $(DOCS_VENV)/.installed
AUDIT_VENV := $(VENV)-audit
AUDIT_STAMP := $(AUDIT_VENV)/.installed

# Everything is compiled once for all the processes that a target starts, whatever the machine's default is.
export PYTHONDONTWRITEBYTECODE =

.PHONY: venv test slow-test service-deps service-test fault-deps fault-test lint style types deploy-lint docs docs-lint spelling audit demo bench bench-large clean

venv: $(STAMP)

# The locks are complete, so pip resolves nothing. It compiles nothing: of the many modules that are installed few are
# loaded, and those are compiled then.
INSTALL = -m pip install --quiet --disable-pip-version-check --no-deps --no-compile
# The pip that comes with Python 3.11 needs twice the time.
PIP := $(shell grep '^pip==' requirements-dev.lock)
# $(call environment,FOLDER,LOCK): an environment with what a lock names.
environment = { test -x $(1)/bin/python || $(PYTHON) -m venv $(1); } \
	&& $(1)/bin/python $(INSTALL) $(PIP) && $(1)/bin/python $(INSTALL) -r $(2)

# The project itself is installed in place.
$(STAMP): requirements.lock requirements-dev.lock pyproject.toml
	$(call environment,$(VENV),requirements-dev.lock)
	$(BIN)/python $(INSTALL) --no-build-isolation --editable .
	touch $@

# In random order; its seed is printed. In the order of the files: make test OPTIONS="-p no:randomly".
# Ordered by their number of tests, files with few long ones would come last, and one processor wait for them.
test: $(STAMP)
	$(BIN)/python -m pytest -m "not slow and not service and not fault" --numprocesses auto --dist loadfile --no-loadscope-reorder $(OPTIONS)

# Debian's packages that the service tests need; as root.
service-deps:
	apt-get update -q
	DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends chromium nginx-light postgresql poppler-utils systemd

# Files and folders that mark service tests; three workers would load all other tests for nothing. Those that take
# longest come first: no worker is left alone with one at the end.
MARKED = $(sort $(patsubst %/conftest.py,%,$(shell grep -rl --include='*.py' 'mark\.service' tests)))
LONGEST = $(addprefix tests/service/test_,serve.py serve_ends.py deploy.py interrupted_runs.py browser.py)
SERVICE_TESTS = $(LONGEST) $(filter-out $(LONGEST),$(MARKED))

# A missing service is a failure here, never a skip. In the order of a file: its tests share a server.
# Three at a time on two processors, because half of the time is waiting; no more, because some of them measure
# how long an end takes.
service-test: $(STAMP)
	$(BIN)/python -m pytest $(SERVICE_TESTS) -m service -p no:randomly --numprocesses 3 --dist loadfile --no-loadscope-reorder $(OPTIONS)

slow-test: $(STAMP)
	$(BIN)/python -m pytest -m slow $(OPTIONS)

# Many projects through an inbox, and faults while they are computed; as root, with PostgreSQL and libfaketime.
fault-deps: service-deps
	DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends faketime

fault-test: $(STAMP)
	$(BIN)/python -m pytest -m fault -p no:randomly -s tests/faults $(OPTIONS)

lint: style types

style: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: $(STAMP)
	$(BIN)/mypy

# Checkers of deploy/, in an environment of their own.
$(DEPLOY_STAMP): requirements-deploy.lock
	$(call environment,$(DEPLOY_VENV),requirements-deploy.lock)
	touch $@

deploy-lint: $(DEPLOY_STAMP)
	$(DEPLOY_VENV)/bin/hadolint deploy/Dockerfile
	$(DEPLOY_VENV)/bin/check-jsonschema --builtin-schema vendor.compose-spec deploy/compose.yaml
	$(DEPLOY_VENV)/bin/kubernetes-validate deploy/kubernetes/aerocal.yaml
	$(DEPLOY_VENV)/bin/shellcheck deploy/init.sh

# The documentation site, in build/site; what builds it, in an environment of its own, needs no network.
$(DOCS_STAMP): requirements-docs.lock
	$(call environment,$(DOCS_VENV),requirements-docs.lock)
	touch $@

# Every warning is an error: a broken link, a missing anchor, a docstring that cannot be read.
docs: $(DOCS_STAMP) spelling
	$(DOCS_VENV)/bin/python -m docs.generate.site
	@echo "The documentation is in build/site/index.html."

# The same without writing pages, for CI: links, anchors, pictures and docstrings are resolved as for the site.
docs-lint: $(DOCS_STAMP) spelling
	$(DOCS_VENV)/bin/sphinx-build -q -W --keep-going -E -a -b dummy -c docs . build/docs-lint

# Pages against a dictionary and the words of the field in docs/words.txt; sources against common misspellings.
spelling: $(DOCS_STAMP)
	$(DOCS_VENV)/bin/python -m docs.generate.spelling
	$(DOCS_VENV)/bin/codespell

# Known vulnerabilities of everything locked. It asks PyPI's advisories over the network, so CI does not run it.
$(AUDIT_STAMP): requirements-audit.lock
	$(call environment,$(AUDIT_VENV),requirements-audit.lock)
	touch $@

# Strict: a package that cannot be audited fails the audit like one that is vulnerable.
audit: $(AUDIT_STAMP)
	failed=; for lock in requirements*.lock; do \
		echo "$$lock"; \
		$(AUDIT_VENV)/bin/python -m pip_audit --strict --no-deps --disable-pip --progress-spinner off -r $$lock \
			|| failed="$$failed $$lock"; \
	done; \
	test -z "$$failed" || { echo "NOT AUDITED, or vulnerable:$$failed (see above; the audit needs the network)" >&2; exit 1; }

demo: $(STAMP)
	$(BIN)/aerocal flight-check uce-calibration --calibrate --out results/demo

# The peer is an extra of its own; nothing else needs it.
$(BENCH_STAMP): $(STAMP) requirements-bench.lock
	$(BIN)/python $(INSTALL) -r requirements-bench.lock
	touch $@

bench: $(BENCH_STAMP)
	$(BIN)/python -m benchmarks compare
	$(BIN)/python -m benchmarks growth
	$(BIN)/python -m benchmarks start-up

bench-large: $(STAMP)
	$(BIN)/python -m benchmarks growth --large

clean:
	rm -rf results build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
