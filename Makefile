# Two commands on a fresh machine: `make demo` and `make test`.
VENV := .venv
PYTHON := python3
LOWEST := .venv-lowest
BIN := $(VENV)/bin
RESULTS := results
export PYTHONDONTWRITEBYTECODE := # empty: without bytecode every process of the tests compiles its imports

.PHONY: demo test test-portable test-lowest test-faults test-kills test-mpi test-slurm test-browser check validate docs wheel smoke memory paper paper-quick clean

$(VENV)/.core: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -e ".[plot]"
	touch $@

$(VENV)/.test: $(VENV)/.core
	$(BIN)/pip install --quiet --disable-pip-version-check -e ".[test]"
	touch $@

demo: $(VENV)/.core ## the paper's default surface on six elastomers: study, table, figures
	mkdir -p $(RESULTS)
	$(BIN)/gfmd run configs/demo.toml -o $(RESULTS)/demo.h5
	$(BIN)/gfmd analyze $(RESULTS)/demo.h5 --figures $(RESULTS)/figures > $(RESULTS)/demo.txt
	cat $(RESULTS)/demo.txt

smoke: $(VENV)/.core ## the smallest complete study
	mkdir -p $(RESULTS)
	$(BIN)/gfmd run configs/smoke.toml -o $(RESULTS)/smoke.h5
	$(BIN)/gfmd analyze $(RESULTS)/smoke.h5

PYTEST := pytest -n 2 --dist loadfile
# Files whose tests solve contacts on grids: threads change only their last bits.
SOLVING := accuracy bench contact_stiffness direct_start dual free_accuracy free_boundary \
	free_contact_stiffness grid local_start multigrid observables_on_request properties \
	rectangular_cells reference_solvers restarts search solvers study true_contact void

test: $(VENV)/.test ## the whole suite, with the newest versions that pip found for a new .venv
	$(BIN)/$(PYTEST)

test-portable: $(VENV)/.test ## the suite with the last bits of other machines: a plain processor; then three threads
	env $$($(BIN)/python scripts/plain_processor.py) NUMBA_CACHE_DIR=$(CURDIR)/$(VENV)/plain-kernels \
		GFMD_PLANS=estimated $(BIN)/$(PYTEST)
	GFMD_PLANS=estimated GFMD_TEST_THREADS=3 $(BIN)/$(PYTEST) $(SOLVING:%=tests/test_%.py)

$(LOWEST)/.test: pyproject.toml $(VENV)/.test
	$(BIN)/uv venv --quiet --clear --python $(BIN)/python $(LOWEST)
	$(BIN)/uv pip install --quiet --python $(LOWEST) --compile-bytecode \
		--resolution lowest-direct -e ".[test]"
	touch $@

test-lowest: $(LOWEST)/.test ## the suite with the lowest versions that pyproject.toml allows
	NUMBA_CACHE_DIR=$(CURDIR)/$(LOWEST)/kernels $(LOWEST)/bin/$(PYTEST)

$(VENV)/.mpi: $(VENV)/.test
	$(BIN)/pip install --quiet --disable-pip-version-check -e ".[mpi]"
	touch $@

test-mpi: $(VENV)/.mpi ## runs shared by several processes, with PyPI's MPICH
	$(BIN)/pytest -m mpi tests/mpi
test-slurm: $(VENV)/.test ## array jobs on a private Slurm: preempted, killed, completed, compared
	tests/slurm/install.sh
	$(BIN)/pytest -m slurm tests/slurm

$(VENV)/.browser: $(VENV)/.test
	$(BIN)/pip install --quiet --disable-pip-version-check -e ".[browser]"
	touch $@

test-browser: $(VENV)/.browser ## the report in a headless Chromium: widths, colours, keys, accessibility
	tests/browser/install.sh
	$(BIN)/pytest -m browser tests/browser

check: $(VENV)/.test ## the one gate: lint, format, types, import order
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy --platform darwin --cache-dir .mypy_cache/darwin
	$(BIN)/lint-imports

validate: $(VENV)/.test ## slow physics: large grids, dense ladders; slow blocks of the documentation
	$(BIN)/$(PYTEST) -m validation

test-kills: $(VENV)/.test ## 500 runs whose parent or workers are killed, 200 forged states: an hour
	GFMD_KILLS=500 $(BIN)/pytest -m faults -rP -n 2 --dist load tests/faults/test_kills.py
	GFMD_FORGERIES=200 $(BIN)/pytest tests/test_forged_states.py tests/test_forged_records.py \
		tests/test_forged_benches.py tests/test_forged_wisdom.py

test-faults: $(VENV)/.test ## kills, full disks, damaged files, hostile input; root, for its small disks
	$(BIN)/pytest -m faults -n 2 --dist load

$(VENV)/.docs: $(VENV)/.test
	$(BIN)/pip install --quiet --disable-pip-version-check -e ".[docs]"
	touch $@

docs: $(VENV)/.docs ## the documentation as a site, in site/index.html
	$(BIN)/python scripts/reference_pages.py --check
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

wheel: $(VENV)/.docs ## the package built, checked and tried in an empty environment
	$(BIN)/python scripts/try_wheel.py

memory: $(VENV)/.core ## measured peak memory against what --dry-run says
	$(BIN)/python scripts/memory.py

paper: $(VENV)/.core ## every figure and statement of the paper: two hours
	$(BIN)/python scripts/paper_figures.py -o $(RESULTS)/paper --page docs/paper.md

paper-quick: $(VENV)/.core ## the same on small grids: minutes
	$(BIN)/python scripts/paper_figures.py -o $(RESULTS)/paper-quick --quick

clean:
	rm -rf $(RESULTS) site dist
