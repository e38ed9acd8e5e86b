# Two commands on a fresh machine with Python 3.11+ and make: `make run` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready

.PHONY: run test test-long test-fleet check lint kernels bench bench-compare reliability campaign screenshots screenshots-check pictures setup debian clean

run: setup
	$(BIN)/bewarenav console $(ARGS)

# Linters, types and all tests but the `long` ones: about 15 minutes on two cores.
test: setup
	@$(MAKE) --no-print-directory --jobs=2 lint kernels debian
	$(BIN)/pytest --numprocesses=2 --dist=worksteal -m 'not long'

# The tests that take long and are no part of `test`: before a release, and after a change of what they test.
test-long: setup
	@$(MAKE) --no-print-directory --jobs=2 kernels debian
	$(BIN)/pytest --numprocesses=2 --dist=worksteal -m long

# The Ray engine on a cluster of two nodes on this machine, one of which is killed. Ray is 70 MB, so it is no part of `test`.
test-fleet: setup
	@.ci/install $(BIN)/python --constraint constraints.txt --editable '.[dev,fleet]'
	$(BIN)/pytest -q tests/app/fleet

# For daily work: the linters, the types, and the tests of the rooms that differ from the last commit.
check: lint
	$(BIN)/pytest -q $$($(BIN)/python -m tests.changed_rooms)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Compile the kernels beside the linters, once, by a short drive: else each test process compiles them for itself.
kernels: setup
	-@$(BIN)/bewarenav drive --scenario empty_room --goal=-1,-2.5 --segmenter colour >/dev/null

bench: setup
	$(BIN)/bewarenav bench $(ARGS)

# Two revisions measured in turn: `make bench-compare REV=main~5 ARGS=tick`. Minutes.
bench-compare: setup
	$(BIN)/bewarenav bench $(or $(ARGS),tick) --against $(REV)

# What holds when something goes wrong, measured: faults are injected and the promises about stopping judged. Minutes.
reliability: setup
	$(BIN)/python -m tests.reliability $(ARGS)

# The promise of the office, measured: ten seeded missions, judged by the referee. Minutes, so it is no part of `test`.
campaign: setup
	$(BIN)/bewarenav evaluate office --episodes 10 --seed 0 --workers 2 --out runs/campaign $(ARGS)

# The twelve main states of the page in three sizes and two themes: renew the references, or compare with them. Minutes.
screenshots: setup
	$(BIN)/python -m tests.screenshots take

screenshots-check: setup
	$(BIN)/python -m tests.screenshots check

# The READMEs' pictures, by a drive in the simulated office.
pictures: setup
	$(BIN)/python -m tests.screenshots pictures

setup: $(READY)

$(READY): pyproject.toml constraints.txt Makefile
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed, this is " + sys.version)'
	@$(PYTHON) -m venv $(VENV) || { echo "No virtual environment could be made; on Debian install python3-venv."; exit 1; }
	@.ci/install $(BIN)/python --constraint constraints.txt --editable '.[dev]'
	@touch $(READY)

debian:
	@.ci/debian

clean:
	rm -rf $(VENV) build *.egg-info
