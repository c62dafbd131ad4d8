# Two commands do everything on a fresh machine: `make demo` and `make test`. `make help` lists the rest.
# Needs only: GNU make, and Python 3.11 or 3.12 with its venv module. Never calls sudo.

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c

# Where this file lies, also when it was named by `make -f some/where/Makefile`. Paths with spaces are fine.
ROOT := $(shell cd "$$(dirname "$$(printf %s '$(MAKEFILE_LIST)' | sed 's/^ //')")" && pwd -P)
HERE := $(shell pwd -P)

GOALS := help demo test test-slow test-soak lint docs check clean iterate status
.PHONY: $(GOALS)

ifneq ($(ROOT),$(HERE))
$(GOALS):
	@$(MAKE) --no-print-directory -C "$(ROOT)" $@
else

PYTHON ?= python3
VENV   := .venv
PY     := $(VENV)/bin/python
# Compiled Python is kept, whatever the shell says: the suite starts some hundred processes, and rewrites every test file.
unexport PYTHONDONTWRITEBYTECODE
# Two workers on the two cores; `make test PYTEST_FLAGS=` runs in one process, `PYTEST_FLAGS="-k store"` a part.
# In the order of the names: xdist would leave files of one long test for the end, when the other worker has nothing to do.
PYTEST_FLAGS ?= -n auto --dist loadfile --no-loadscope-reorder
DEMO   ?= demo
# Its projects share what is compiled for the robot that they share.
demo: export R2S2R_CACHE ?= $(abspath $(DEMO))/cache
PROJECT ?= .
ITER   ?= 001
SOURCE ?=
PORT   ?=
CAMERA ?=

help:  ## this list
	@printf 'usage: make TARGET\n\n'
	@sed -n 's/^\([a-z -]*\):.*##  *\(.*\)/  \1\t\2/p' Makefile | expand -t 14

demo: $(VENV)/.demo-stamp  ## a sample project and a diagnosis, beside them two iterations of the loop on the virtual robot (in ./demo)
	@mkdir -p "$(DEMO)"
	@echo "beside the two iterations: a first project and a diagnosis, whose words go to $(DEMO)/beside.txt"
	@$(MAKE) --no-print-directory -j2 demo-loop demo-beside
	@cat "$(DEMO)/beside.txt"

# Parts of `demo`, side by side: each needs little more than one core. make ends both at Ctrl-C.
.PHONY: demo-loop demo-beside
demo-loop demo-beside: export PATH := $(ROOT)/$(VENV)/bin:$(PATH)
demo-loop:
	@bash examples/13_two_iterations/run.sh "$(DEMO)/two-iterations"
demo-beside:
	@{ bash examples/01_first_project/run.sh "$(DEMO)" && bash examples/14_diagnose/run.sh --out "$(DEMO)/diagnosis"; } \
	  > "$(DEMO)/beside.txt" 2>&1 || { cat "$(DEMO)/beside.txt"; exit 1; }

# What the tests compile is kept for the next time: it goes by a name that counts all sources of the engine.
test test-slow test-soak: export R2S2R_CACHE ?= $(abspath $(VENV))/kernels

test: $(VENV)/.dev-stamp  ## the test suite, without the slow tests
	@$(PY) -m pytest $(PYTEST_FLAGS)

test-slow: $(VENV)/.dev-stamp  ## the slow tests: kills while writing, damaged files, malformed inputs
	@$(PY) -m pytest $(PYTEST_FLAGS) -m slow

test-soak: $(VENV)/.dev-stamp  ## what is killed, damaged or hidden at random, in full numbers (an hour): before a release
	@R2S2R_SOAK=1 $(PY) -m pytest $(PYTEST_FLAGS) -m slow -k "killed or mutants or mutated or damaged or flipped or plug or known_seeds or grows or every_stage_gives or test_parity or converges_from_both or many_moments" tests/store tests/commands tests/hardware tests/blind tests/examples tests/engine

lint: $(VENV)/.dev-stamp  ## style, types, import layers
	@failed=; \
	look() { echo "== $$*"; "$$@" || failed="$$failed, $$1 $$2"; }; \
	PATH="$(ROOT)/$(VENV)/bin:$$PATH"; \
	look ruff check .; \
	look ruff format --check --quiet .; \
	look mypy --no-error-summary; \
	look lint-imports --no-logo --no-cache; \
	if [ -n "$$failed" ]; then echo "make lint failed:$${failed#,}"; exit 1; fi

docs: $(VENV)/.run-stamp  ## regenerate docs/reference, schemas/json and schemas/LAYOUT.md
	@$(PY) -m schemas.generate
	@$(PY) -m r2s2r_cli.docs

check: lint test  ## lint and test: what to run before a commit

iterate status: $(VENV)/.run-stamp  ## the loop of a project: make iterate PROJECT=dir ITER=001 [SOURCE=log.csv | PORT=... CAMERA=...]
	@$(MAKE) --no-print-directory -C "$(PROJECT)" -f "$(ROOT)/r2s2r_cli/templates/project.mk" $@ \
	  R2S2R="$(ROOT)/$(VENV)/bin/r2s2r" ITER="$(ITER)" SOURCE="$(SOURCE)" PORT="$(PORT)" CAMERA="$(CAMERA)"

clean:  ## remove what this Makefile made: .venv, ./demo, caches
	rm -rf "$(VENV)" demo build dist r2s2r.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find r2s2r_cli schemas tests -name __pycache__ -type d -prune -exec rm -rf {} +

# The virtual environment. A stamp is older than pyproject.toml: the dependencies are brought up to date.
# `--editable`: a change of the source needs no new installation.
$(VENV)/.run-stamp: pyproject.toml .ci/system-libs .ci/venv
	@bash .ci/system-libs
	@bash .ci/venv "$(PYTHON)" "$(VENV)" '.'
	@touch $@

# The virtual robot is simulated by MuJoCo, which nothing else needs.
$(VENV)/.demo-stamp: pyproject.toml .ci/system-libs .ci/venv
	@bash .ci/system-libs
	@bash .ci/venv "$(PYTHON)" "$(VENV)" '.[rig]'
	@touch $@ $(VENV)/.run-stamp

$(VENV)/.dev-stamp: pyproject.toml .ci/system-libs .ci/venv
	@bash .ci/system-libs
	@bash .ci/venv "$(PYTHON)" "$(VENV)" '.[dev]'
	@touch $@ $(VENV)/.run-stamp $(VENV)/.demo-stamp

endif
