# stiffdice: `make paper` rebuilds the paper, `make test` tests each promise; both set themselves up.

PYTHON ?= python3
VENV := .venv
# The folder that the link .venv leads to: what has begun goes on there when a new one takes its place.
BIN = $(or $(realpath $(VENV)),$(VENV))/bin
# It takes the place of its shell, and ends with make, however that ends.
# VERBOSE=1 shows all that Snakemake says.
RUN = exec $(BIN)/python workflow/run.py --end-with-parent --cores $(CORES) $(if $(VERBOSE),--verbose)
CORES ?= $(shell nproc 2>/dev/null || echo 2)
STUDY ?= paper

.DEFAULT_GOAL := help
.PHONY: help install install-engines paper stability extremes tradeoff refinement landing engines pair pair-engines tosses shapes study status report report-finished report-study archive bench sweep-million test test-fast test-all test-slurm figures-baseline mutants lint types check docs lock clean

help:  ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-15s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

install:  ## set up .venv from the lock files, unless it is what they say (the other targets do it, too; status only tells)
	@PYTHON="$(PYTHON)" requirements/install

install-engines: install  ## add the engines that are measured beside ours (MuJoCo, Drake, DART, PyBullet; 0.5 GB)
	@PYTHON="$(PYTHON)" $(BIN)/python requirements/install_engines.py

paper: install  ## rebuild everything the paper shows, into results/paper/
	@$(RUN) paper

stability: install  ## measure what "stable" means, into results/stability/
	@$(RUN) stability

extremes: install  ## where and how runs fail at the extremes, into results/extremes/
	@$(RUN) extremes

tradeoff: install  ## what accuracy costs by scheme, into results/tradeoff/
	@$(RUN) tradeoff

refinement: install  ## a dense grid's answer for fewer runs, into results/refinement/
	@$(RUN) refinement

landing: install  ## how often each face of a die is up, and how coarse steps may be for that, into results/landing/
	@$(RUN) landing

engines: install  ## the engines that are installed beside stiffdice, into results/engines/
	@$(RUN) engines

pair-engines: install  ## two boxes in MuJoCo and Drake beside stiffdice, into results/pair-engines/
	@$(RUN) study --config study=pair-engines

tosses: install  ## real tosses of a cube, and the simulation beside them, into results/tosses/
	@$(RUN) tosses

shapes: install  ## which face of a box comes up by shape and load, into results/shapes/
	@$(RUN) shapes

pair: install  ## two cubes: the steps they need, how they leave each other, orders of schemes, into results/pair/
	@$(RUN) pair

study: install  ## run config/NAME.yaml, into results/NAME/: make study STUDY=NAME
	@$(RUN) study --config 'study=$(STUDY)'

status:  ## how far a study is, what failed and why: make status STUDY=NAME
	@PYTHON="$(PYTHON)" requirements/install --check
	@$(BIN)/stiffdice status '$(STUDY)' || [ $$? -ne 2 ]

LOOK := --report-stylesheet workflow/report/report.css
# Of the study that is named, which is run first; else of those that are finished.
report: $(if $(filter file,$(origin STUDY)),report-finished,report-study)  ## results/report.html: all finished studies; or run one, into results/NAME/report.html: make report STUDY=NAME

report-finished: install
	@$(BIN)/snakemake --cores $(CORES) finished --report results/report.html $(LOOK)

report-study: study
	@$(BIN)/snakemake --cores $(CORES) study --config 'study=$(STUDY)' --report 'results/$(STUDY)/report.html' $(LOOK)

archive: report-study  ## run config/NAME.yaml and pack it with all that made it, into results/archives/: make archive STUDY=NAME
	@$(BIN)/stiffdice archive '$(STUDY)'

bench: install  ## measure how fast it is, into results/bench/, and compare with the last time
	@$(BIN)/python -m benchmarks

sweep-million: install  ## a sweep of 1e4, 1e5 and 1e6 runs, measured, into results/scale/ (about half an hour)
	@$(BIN)/python -m benchmarks.scale $(MILLION)

# Where the environment says to keep no bytecode, each worker would prepare all tests, and each process compile all code.
test test-fast test-all: export PYTHONDONTWRITEBYTECODE =

test: install  ## run the tests: each promise once
	@$(BIN)/python -m pytest -m "not broad"

test-fast: install  ## run those of them that are short
	@$(BIN)/python -m pytest -m "not broad and not long"

test-all: install  ## run all tests, with many draws, faults and kills of a promise, as .ci/run does
	@$(BIN)/python -m pytest

test-slurm: install  ## run a sweep on a Slurm of two nodes that lives for it alone, and kill parts of it (root, Debian's packages)
	@tests/slurm/run $(BIN)/python

# Where matplotlib is the locked one; look at them before.
figures-baseline: install  ## write the pictures anew that figures are compared with, after a change that is meant
	@$(BIN)/python -m pytest -n 0 tests/report/figures/test_looks.py --mpl-generate-path=tests/report/baseline

MODULES ?= dynamics/linear_theory integrators/linear_stability sweep/partition sweep/stability_limits
mutants: install  ## break modules in a dozen places each, and tell what their tests do not notice: make mutants MODULES=sweep/grid
	@$(BIN)/python -m tests.mutation $(MODULES)

lint: install  ## check style (ruff), which package imports which (import-linter), and the workflow (snakemake --lint)
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/lint-imports --no-cache && $(BIN)/snakemake --lint

types: install  ## check types (mypy)
	@$(BIN)/mypy

check: lint types test  ## all of the above

docs: install  ## write docs/reference/api.md from the docstrings of the public names, the tables of docs/reference/FORMAT.md from the schema
	@$(BIN)/python docs/make_api.py && $(BIN)/python docs/make_format.py

lock: install  ## renew the lock files from requirements/*.in (needs uv on the PATH)
	@for name in build requirements engines docs; do \
	  uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --fork-strategy fewest \
	    --no-emit-index-url --custom-compile-command "make lock" \
	    requirements/$$name.in -o requirements/$$name.lock; done
	@$(BIN)/python requirements/write_conda_env.py

clean:  ## remove results (keeps .venv)
	@$(PYTHON) workflow/clean.py
