# `make demo` and `make test` set everything up first; nothing else is needed but Python 3.11 to 3.13.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test check bench trials notebook lock clean

demo: .venv/ready
	$(BIN)/whyhot demo

test: .venv/ready check
	$(BIN)/python -m pytest -n 2 --dist loadfile

check: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: .venv/ready
	$(PIP) -r requirements-bench.lock
	$(BIN)/python benchmarks/ingest.py
	$(BIN)/python benchmarks/integrator.py
	$(BIN)/python benchmarks/calibration.py
	$(BIN)/python benchmarks/filters.py
	$(BIN)/python benchmarks/paper.py
	$(BIN)/python benchmarks/hot_spots.py
	$(BIN)/python benchmarks/sensors.py
	$(BIN)/python benchmarks/twin.py
	$(BIN)/python benchmarks/warehouse.py
	$(BIN)/python benchmarks/ageing.py
	$(BIN)/python benchmarks/ageing_forms.py
	$(BIN)/python benchmarks/fleet.py
	$(BIN)/python benchmarks/stress.py
	$(BIN)/python benchmarks/checks.py

# How often a hidden effect is named, and nothing where nothing is hidden: hours, and it goes on where it was interrupted.
trials: .venv/ready
	$(BIN)/python benchmarks/trials.py

notebook: .venv/ready
	$(BIN)/marimo edit notebooks

# uv where it is there (seconds), pip otherwise (a minute): both install the same locked versions.
PIP := $(shell command -v uv >/dev/null 2>&1 && echo "uv pip install -q --compile-bytecode --python $(BIN)/python" || echo "$(BIN)/python -m pip install -q --disable-pip-version-check")

.venv/ready: requirements.lock pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(PIP) -r requirements.lock
	$(PIP) --no-deps -e .
	touch $@

# New versions: names and versions only, so that a lock works with any package index.
lock:
	@command -v uv >/dev/null || { echo "make lock needs uv on the PATH: pip install uv" >&2; exit 1; }
	uv pip compile pyproject.toml --extra view --extra notebooks --extra tdms --group dev --universal --python-version 3.11 --no-header --no-annotate --upgrade -q -o requirements.lock
	uv pip compile pyproject.toml --extra view --extra notebooks --extra tdms --group dev --group bench --universal --python-version 3.11 --no-header --no-annotate --upgrade -q -o requirements-bench.lock

clean:
	rm -rf .venv demo dist build .mypy_cache .pytest_cache .ruff_cache
