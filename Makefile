# Each target sets up what it needs in .venv, on a machine that has Python 3.11 or newer, make and git.
#   make run     the XP train: results on the screen, figures as PNG
#   make test    the tests and doctests; ARGS are handed to pytest: make test ARGS="-k clutch"

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help run test slow bench stress mutate docs versions wheel check format clean

VENV := .venv
BIN := $(VENV)/bin
PYTEST := $(BIN)/python -m pytest
ARGS ?=
export MPLBACKEND ?= Agg
# For small matrices threads cost more than they bring.
export OPENBLAS_NUM_THREADS ?= 1

help:
	@echo "make run     simulate the XP train (examples/xp_train.py)"
	@echo "make test    tests and doctests (ARGS=... are handed to pytest)"
	@echo "make slow    the tests that take long"
	@echo "make bench   benchmarks against other solvers"
	@echo "make stress  large, long and random models"
	@echo "make mutate  change the code in many places, one at a time: does a test notice?"
	@echo "make docs    documentation, in docs/_build/html"
	@echo "make versions  the same, kept by version in docs/_build/versions"
	@echo "make wheel   the wheel of a release, in dist"
	@echo "make check   style, types and layers"
	@echo "make format  apply the style"
	@echo "make clean   remove .venv, caches and built files"

run: $(VENV)/.installed-plot
	@echo "The first run on a machine compiles the solvers, which takes some seconds."
	$(BIN)/python examples/xp_train.py
	@echo "Figures: examples/figures/time_histories.png, nyquist.png, nichols.png"

test: $(VENV)/.installed-test
	$(PYTEST) -n 2 --dist loadfile $(ARGS)

slow: $(VENV)/.installed-slow
	$(PYTEST) -m slow $(ARGS)

bench: $(VENV)/.installed-bench
	$(PYTEST) -m benchmark -s tests/benchmarks $(ARGS)

stress: $(VENV)/.installed-test
	$(PYTEST) -m stress $(ARGS)

mutate: $(VENV)/.installed-mutate
	$(BIN)/python tests/mutation.py $(ARGS)

docs: $(VENV)/.installed-docs
	$(BIN)/python -m sphinx -q -W --keep-going -d .cache/sphinx docs docs/_build/html
	$(BIN)/python docs/clicks.py
	@echo "docs/_build/html/index.html"

versions: docs
	$(BIN)/python docs/versions.py

wheel: $(VENV)/.installed-release
	$(BIN)/python docs/wheel.py

check: $(VENV)/.installed-check
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports --cache-dir .cache/import-linter

format: $(VENV)/.installed-check
	$(BIN)/ruff check --fix-only
	$(BIN)/ruff format

clean:
	rm -rf $(VENV) .cache build dist docs/_build docs/gallery

# gearlib with one of its extras; a change of pyproject.toml installs again.
$(VENV)/.installed-%: pyproject.toml $(VENV)/.created
	@echo "installing gearlib[$*] in $(VENV) ..."
	@$(BIN)/python -m pip install --disable-pip-version-check -q -e '.[$*]'
	@touch $@

# A .venv whose interpreter no longer runs, or that was moved here from elsewhere, is made anew.
usable := $(shell $(BIN)/python -c 'import os, sys; print(os.path.samefile(open("$(VENV)/.created").read(), sys.prefix))' 2>/dev/null)
ifneq ($(usable),True)
.PHONY: $(VENV)/.created
endif

# A candidate counts when it runs and can make an environment: a version manager's stand-in, or a Python without ensurepip, does not.
$(VENV)/.created:
	@for python in python3.13 python3.12 python3.11 python3.14 python3 python; do \
		if $$python -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then \
			echo "making $(VENV) with $$python ..."; \
			$$python -m venv --clear $(VENV) && printf '%s' "$$PWD/$(VENV)" >$@; exit; \
		fi; \
	done; \
	echo "No Python 3.11 or newer with venv and ensurepip was found (on Debian and Ubuntu: apt install python3-venv)." >&2; \
	exit 1
