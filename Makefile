# make demo: the main job on a fresh machine; make test: the tests. Each makes .venv itself.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test lint figures bench clean

demo: $(READY)
	$(BIN)/python build_fmu.py
	$(BIN)/linkwork check table-3.1 slider-crank-torque --method compiled --method Radau --out out

test: $(READY) lint
	$(BIN)/python build_fmu.py
	# the file that takes longest goes first, lest one core wait for it at the end
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile tests/test_docs.py tests

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

figures: $(READY)
	$(BIN)/linkwork figures --out out/figures

bench: $(READY)
	$(BIN)/pip install --quiet --editable '.[dev,bench]'
	$(BIN)/python -m benchmarks.solvers
	$(BIN)/python -m benchmarks.fmu
	$(BIN)/python -m benchmarks.stability
	$(BIN)/python -m benchmarks.synthesis
	$(BIN)/python -m benchmarks.slider_crank

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "Linkwork needs Python 3.11 or newer: set PYTHON=python3.x")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $(READY)

clean:
	rm -rf $(VENV) build out
