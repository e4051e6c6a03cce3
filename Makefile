# The first interpreter that is new enough; "python3.11" where none is, for the message below.
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3; do \
  $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && exit; done; echo python3.11)
VENV := .venv
BIN := $(VENV)/bin
SAMPLE := reports/sample
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
export MKL_NUM_THREADS := 1

.DEFAULT_GOAL := help
.PHONY: help calibrate test test-long score gains benchmark diagnose lint sample clean

help:
	@echo "make calibrate   calibrate the bundled data sets; reports in reports/*/report.html"
	@echo "make test        linters, types, doctests and the test suite"
	@echo "make test-long   the long statistical tests: some hours in all"
	@echo "make score       score diagnose on the locked hidden cases (resumable; SET=develop, practice, locked-halved ...)"
	@echo "make gains       what named causes gain on held-out rows, beside an oracle (resumable; CASES=30)"
	@echo "make benchmark   times the sampler beside nutpie and PyMC, in an environment of its own"
	@echo "make diagnose    diagnose the bundled data sets; table in reports/diagnosed.md"
	@echo "make lint        linters and types alone"
	@echo "make sample      make $(SAMPLE) again (the picture needs chromium)"
	@echo "make clean       remove the virtual environment, reports and caches"

$(VENV)/.installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	  echo "error: found no Python 3.11 or newer; name one: make PYTHON=/usr/bin/python3.11 ..." >&2; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { \
	  echo "error: no virtual environment could be made (on Debian: apt-get install python3-venv)" >&2; exit 1; }
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -e '.[test]'
	@touch $@

calibrate: $(VENV)/.installed
	@$(BIN)/python datasets/calibrate_all.py

test: lint
	$(BIN)/python -m pytest --doctest-modules mpam_calib
	$(BIN)/python -m pytest -m "not long" -n 2 --dist loadfile --durations=15

test-long: $(VENV)/.installed
	$(BIN)/python -m pytest -m long --durations=0

SET ?= locked
score: $(VENV)/.installed
	cd tests && ../$(BIN)/python -W ignore -m criticism.score $(SET)

CASES ?= 30
gains: $(VENV)/.installed
	cd tests && ../$(BIN)/python -W ignore -m criticism.gains $(SET) $(CASES)

BENCHMARKS := .venv-benchmarks
$(BENCHMARKS)/.installed: pyproject.toml tests/benchmarks/requirements.txt
	@$(PYTHON) -m venv $(BENCHMARKS)
	$(BENCHMARKS)/bin/python -m pip install --quiet --upgrade pip
	$(BENCHMARKS)/bin/python -m pip install --quiet -e . -r tests/benchmarks/requirements.txt
	@touch $@

benchmark: $(BENCHMARKS)/.installed
	@cd tests && ../$(BENCHMARKS)/bin/python -W ignore -m benchmarks

diagnose: $(VENV)/.installed
	mkdir -p reports
	$(BIN)/python datasets/diagnose_all.py reports/diagnosed.md

lint: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

sample: $(VENV)/.installed
	$(BIN)/mpam-calib calibrate datasets/mpam1_reconstructed -o reports/mpam1_reconstructed
	mkdir -p $(SAMPLE)
	cp reports/mpam1_reconstructed/report.html $(SAMPLE)/report.html
	chromium --headless --no-sandbox --disable-gpu --hide-scrollbars --window-size=900,1290 \
	  --screenshot=$(SAMPLE)/report.png file://$(CURDIR)/$(SAMPLE)/report.html 2>/dev/null

clean:
	rm -rf $(VENV) $(BENCHMARKS) build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find reports -mindepth 1 -maxdepth 1 ! -name sample -exec rm -rf {} +
