# Everything a fresh machine needs: Python 3.11 or newer and make. `make help` lists the targets.
VENV ?= .venv
N2N_DATA ?= ../shared/data
PROFILE ?= smoke
TORCH_VERSION := 2.13.0

BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
CPU_INDEX := https://download.pytorch.org/whl/cpu
# pyenv puts names on the PATH that do not run, so each candidate is tried.
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3.14 python3 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { echo $$p; break; }; done)

.PHONY: help setup demo test check format bench bench-docs reproduce-tables clean FORCE

help:  ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 18
	@echo
	@echo "NVIDIA GPU: make setup TORCH=torch     (without TORCH a CPU build is installed, no CUDA packages)"

setup: $(STAMP)  ## create .venv with everything installed (does nothing when up to date)

demo: $(STAMP)  ## the main job on a bundled noisy scan; results in out/demo
	@$(BIN)/n2n demo -o out/demo

test: $(STAMP)  ## all tests; those on real scans need N2N_DATA (default ../shared/data)
	@N2N_DATA="$(N2N_DATA)" $(BIN)/python -m pytest

check: $(STAMP)  ## style and import layers
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/lint-imports

format: $(STAMP)  ## rewrite the sources in house style
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

bench: $(STAMP)  ## measure everything, about 25 minutes; BENCH="matching step" only these, BENCH=--help tells more
	@$(BIN)/python -m benchmarks $(BENCH)

bench-docs: $(STAMP)  ## copy the report of `make bench` to docs/benchmarks.md
	@$(BIN)/python -m benchmarks --docs

# What smoke measures means nothing, so it is not kept with the results.
RESULTS = $(if $(filter smoke,$(PROFILE)),out/tables/smoke/results,results/$(PROFILE))
reproduce-tables: $(STAMP)  ## the paper's tables, in out/tables; PROFILE=smoke (minutes), laptop (hours) or paper (a cluster)
	@N2N_DATA="$(N2N_DATA)" $(BIN)/n2n tables run --profile $(PROFILE) --results $(RESULTS)

clean:  ## remove .venv and caches, keep results
	rm -rf $(VENV) .pytest_cache .ruff_cache .import_linter_cache .hypothesis

$(STAMP): pyproject.toml
	@test -n "$(PYTHON)" || { echo "n2n needs Python 3.11 or newer; install it, or: make setup PYTHON=/path/to/python"; exit 1; }
	@echo "setting up $(VENV) with $(PYTHON) (once; minutes, most of it downloads)"
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
		echo "python cannot create environments; on Debian and Ubuntu: apt install python3-venv"; exit 1; }
	@$(install_torch)
	@$(BIN)/python -m pip install -q -e '.[dev]'
	@touch $@

pip := $(BIN)/python -m pip install -q
ifdef TORCH
# The user chose: replace what is there.
$(STAMP): FORCE
install_torch = $(pip) --force-reinstall $(TORCH)
else
# A CPU build from a local index or folder where one is known; then PyTorch's own; then whatever PyPI has.
install_torch = $(BIN)/python -c 'import torch' 2>/dev/null \
	|| $(pip) 'torch==$(TORCH_VERSION)+cpu' 2>/dev/null \
	|| $(pip) 'torch==$(TORCH_VERSION)' --index-url $(CPU_INDEX) 2>/dev/null \
	|| $(pip) 'torch==$(TORCH_VERSION)'
endif
