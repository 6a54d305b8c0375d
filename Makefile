# The checks of .ci/run, on the environment that the README's commands make.
BIN ?= .venv/bin

.PHONY: check lint types imports test deaths goals published times notebooks docs full nightly lowest fuzz bench

check: lint types imports test published docs

# What takes many minutes: long tests, a killed study, damaged files.
nightly: full deaths fuzz

lint:
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python tests/support/house.py

types:
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/mypy --strict --python-executable $(BIN)/python tests/support/typed_script.py

imports:
	$(BIN)/lint-imports

test:
	$(BIN)/pytest -n auto -m "not full"

# A study of 2,000 cases whose worker, scheduler and driver are killed, in a minute of processor time.
deaths:
	$(BIN)/pytest -n 0 tests/study/test_cluster.py -k two_thousand

# Six turns of four small bodies, planned from rest to rest.
goals:
	$(BIN)/pytest -n auto tests/optimal_control/test_plan_goals.py -k reached

# The numbers of docs/published.md, computed anew.
published:
	$(BIN)/python -m benchmarks.published --check

# What each quick test takes of the processor, and the budget.
times:
	$(BIN)/pytest -n auto -m "not full" -p support.processor_time

# Executes the notebooks and writes their outputs, which are committed; NOTEBOOKS="01 08" those alone.
notebooks:
	PYTHONPATH=docs $(BIN)/python -m _site.executed_notebooks $(NOTEBOOKS)

# Executes the notebooks too, once, where a number that is not the one committed is an error; then follows every link, and packs
# the site to be read offline. Needs the extra `docs`.
docs:
	$(BIN)/sphinx-build -nW --keep-going -d docs/_build/doctrees docs docs/_build/html
	PYTHONPATH=docs $(BIN)/python -m _site.built_links docs/_build/html
	cd docs/_build && $(abspath $(BIN))/python -m zipfile -c shapephase-docs.zip html

full:
	$(BIN)/pytest -n auto

# The wheel with the lowest versions that pyproject.toml claims, in an environment of its own. Warnings are no errors there: old
# versions of one package stand beside new ones of another.
OLDEST ?= $(BIN)/python
LOWEST ?= build/lowest
LOWEST_TESTS ?= $(addprefix tests/, body/test_body.py cli/test_main.py deformation/test_deformation.py \
	integrator/test_machine_code.py optimal_control/test_collocation.py phases/test_phases.py plots/test_plots.py \
	reconstruction/test_reconstruction.py reconstruction/test_motion_record.py rigid_body/test_euler_top.py \
	shape_space/files/test_motion_formats.py shape_space/files/test_read.py shape_space/test_connection.py \
	test_array_arguments.py test_cards.py test_so3.py)
lowest:
	$(OLDEST) -m venv --clear $(LOWEST)
	$(LOWEST)/bin/pip install --quiet --prefer-binary hypothesis mpmath pytest pytest-xdist xarray \
		$$($(OLDEST) tests/support/lowest_versions.py bodies data plot)
	$(LOWEST)/bin/pip install --quiet --no-deps .
	$(LOWEST)/bin/pytest -n auto -m "not full" -W default -p no:cacheprovider $(LOWEST_TESTS)

# Twenty minutes of files that are damaged at random; MINUTES and SEED choose others.
MINUTES ?= 20
fuzz:
	PYTHONPATH=src:tests $(BIN)/python -m fuzz --minutes $(MINUTES) $(if $(SEED),--seed $(SEED))

# On a quiet machine: the page of benchmarks is made of what this prints.
bench:
	$(BIN)/python -m benchmarks --keep
	$(BIN)/python -m benchmarks.page
