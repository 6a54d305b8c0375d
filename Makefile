# The checks of .ci/run, on the environment that the README's commands make.
BIN ?= .venv/bin

.PHONY: check lint types imports test times notebooks docs full fuzz bench

check: lint types imports test notebooks

lint:
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types:
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/mypy --strict --python-executable $(BIN)/python tests/support/typed_script.py

imports:
	$(BIN)/lint-imports

test:
	$(BIN)/pytest -n auto -m "not full"

# What each quick test takes of the processor, and the budget.
times:
	$(BIN)/pytest -n auto -m "not full" -p support.processor_time

notebooks:
	$(BIN)/pytest --nbmake notebooks -p no:cacheprovider -W default

# This executes the notebooks with their asserts, as `notebooks` does without Sphinx; it needs the extra `docs`.
docs:
	$(BIN)/sphinx-build -nW --keep-going docs docs/_build/html

full:
	$(BIN)/pytest -n auto

# Twenty minutes of mutated files and command lines; MINUTES and SEED choose others.
MINUTES ?= 20
fuzz:
	PYTHONPATH=src:tests $(BIN)/python -m fuzz --minutes $(MINUTES) $(if $(SEED),--seed $(SEED))

bench:
	$(BIN)/python -m benchmarks
