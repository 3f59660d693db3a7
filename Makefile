# `make demo` and `make test` set everything up first; nothing else is needed but Python 3.11 to 3.13.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test quick check lint types tests bench trials notebook lock clean

# Tests start hundreds of Pythons and two collect: what is compiled once is kept, whatever the environment says.
unexport PYTHONDONTWRITEBYTECODE

demo: .venv/ready
	$(BIN)/whyhot demo

# What takes a second first; mypy needs one processor for a minute, so beside the tests.
test: lint
	@$(MAKE) --no-print-directory -j 2 types tests

tests: .venv/ready
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder --max-worker-restart 0

check: lint types

lint: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/ready
	$(BIN)/mypy

# For the edit loop: checks, and most tests in under a minute. Left out are those that run the whole program or a server, or
# draw many seeds.
quick: .venv/ready check
	$(BIN)/python -m pytest -n 2 --dist loadfile $(addprefix tests/,$(QUICK)) $(addprefix --ignore=tests/,$(SLOW))

QUICK := test_house.py test_make.py ingest twin analytics/insulation replay/engine/files replay/show/plots replay/show/words
SLOW := ingest/catalogue/test_looked.py ingest/intake \
	ingest/formats/test_contract.py ingest/log/test_reading.py ingest/log/test_clock.py \
	ingest/facts/test_ledger.py ingest/facts/test_ledger_index.py ingest/facts/test_ledger_server.py \
	ingest/facts/test_backup.py ingest/facts/test_bucket.py ingest/facts/test_move.py ingest/facts/test_move_files.py \
	ingest/units twin/planning/test_chain.py twin/compiled/test_kernel.py twin/compiled/test_integrators.py \
	twin/compiled/test_circuits.py twin/compiled/test_new_law.py twin/motor/test_slicing.py \
	twin/diagnosis twin/insulation twin/fitting/test_noise.py twin/fitting/test_model_columns.py \
	twin/filters/test_ekf.py twin/calibration/test_calibrate.py twin/calibration/test_united.py \
	twin/run/test_reduction.py twin/run/test_envelope.py twin/run/test_energy_balance.py twin/run/test_paper_form.py \
	twin/run/test_side_by_side.py analytics/insulation/courses/test_forms.py analytics/insulation/checks \
	analytics/insulation/fleet analytics/insulation/life replay/show/plots/test_network_plot.py \
	replay/engine/files/test_motor_versions.py replay/engine/files/test_network_text.py replay/engine/files/test_motor_text.py

# Every file of benchmarks/; one that fails does not stop the others.
bench: .venv/ready
	$(PIP) -r requirements-bench.lock
	@failed=; for file in $(BENCHMARKS); do echo "== $$file"; $(BIN)/python $$file || failed="$$failed $$file"; done; \
	test -z "$$failed" || { echo "failed:$$failed" >&2; exit 1; }

BENCHMARKS := $(filter-out $(addprefix benchmarks/,asked.py shared.py trials.py),$(wildcard benchmarks/*.py))

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

# New versions: names, versions and hashes, so that a lock works with any package index and trusts none.
lock:
	@command -v uv >/dev/null || { echo "make lock needs uv on the PATH: pip install uv" >&2; exit 1; }
	uv pip compile pyproject.toml --extra view --extra notebooks --extra tdms --extra xlsx --extra cluster --extra postgres --extra s3 --group dev --universal --python-version 3.11 --no-header --no-annotate --generate-hashes --upgrade -q -o requirements.lock
	uv pip compile pyproject.toml --extra view --extra notebooks --extra tdms --extra xlsx --extra cluster --extra postgres --extra s3 --group dev --group bench --universal --python-version 3.11 --no-header --no-annotate --generate-hashes --upgrade -q -o requirements-bench.lock

clean:
	rm -rf .venv demo dist build .mypy_cache .pytest_cache .ruff_cache
	find twin replay analytics tests -name __pycache__ -prune -exec rm -rf {} +
