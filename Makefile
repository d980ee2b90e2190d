# `make run` and `make test` do all their set-up themselves; see `make help`.
PYTHON ?= python3
OUT ?= out/run
# The matrices here are small: more threads of the linear algebra only wait for each other.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

BIN := .venv/bin
RUNNER := hil_sim/studies/campaign/native
PACK := hil_sim/studies/pack/native
NATIVE := hil_sim/native
RIVALS := bms/studies/rivals/native
C_PROGRAMS := tests/firmware/native
C_SOURCES := $(wildcard firmware_c/*/*.[ch] firmware_c/pack/generated/*.[ch] $(NATIVE)/*.[ch] $(RUNNER)/*.[ch] $(PACK)/*.[ch] $(RIVALS)/*.[ch])
PAGE := hil_sim/dashboard
PAGE_SOURCES = $(wildcard $(PAGE)/native/*.[ch] $(PAGE)/web/*.* $(PAGE)/web/src/*) $(PAGE)/build.py $(PAGE)/module.py
EXTENSION_BUILD := setup.py tools/native_extensions.py bms/native_build.py \
  bms/studies/rivals/native_build.py hil_sim/native/native_build.py hil_sim/studies/campaign/native_build.py \
  hil_sim/studies/pack/native_build.py
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
PYTEST := $(BIN)/python -m pytest -n 2
# What `make quick` tries: the C core, and of Python what is nearest to it.
QUICK_TESTS ?= $(foreach test, calibration_choice charge_mode codec codec_messages e2e ecu_faults ecu_loop ecu_states history \
    image_check kan rcbf reception slcan soc structure supervision thermal, tests/firmware/test_$(test).py) \
  tests/codegen/test_generated.py $(foreach test, barrier_constants model_file presets, tests/bms/test_$(test).py) \
  $(foreach test, database plant_node replay_golden, tests/hil_sim/test_$(test).py)

.PHONY: help build run page dashboard quick test lint coverage misra mutants proofs evidence generate models verify-tables long-checks fuzz fuzz-frames fuzz-logs benchmark docs clean
.DEFAULT_GOAL := help

help: ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

build: build/extensions ## Build the C extensions anew where their sources have changed

run: build/extensions ## Charge a cell at 10C over a CAN bus and write a report to out/run
	$(BIN)/bms sil --mode fastest --baseline s-cbf --baseline kan-rcbf-fixed --out $(OUT)

page: build/page ## Build the page of `bms dashboard` (needs Node.js with npm)

dashboard: page build/extensions ## Charge a cell in a browser: serves the page on this machine
	$(BIN)/bms dashboard

quick: .venv/tests build/extensions ## Build what changed and run the quick tests of the C core and of Python near it
	$(PYTEST) -q --dist worksteal -m "not slow" $(or $(TESTS),$(QUICK_TESTS))

ifdef TESTS
test: .venv/tests build/extensions ## Everything that must pass: real vcan, images in QEMU, sanitizers; or TESTS=path alone
	$(PYTEST) --dist loadfile $(TESTS)
else
test: .venv/tests .venv/gates build/extensions build/sanitized/done lint
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory page; \
	  else echo "not run: the page in a browser; it needs Node.js with npm" >&2; test -z "$$CI"; fi
	@if command -v arm-none-eabi-gcc >/dev/null && command -v qemu-system-arm >/dev/null; then \
	  $(MAKE) --no-print-directory firmware; \
	else \
	  echo "not run: make firmware; it needs what tools/debian_packages.sh installs" >&2; test -z "$$CI"; \
	fi
	$(PYTEST) --dist loadfile --durations 20
	tools/sanitized_tests.sh
	$(MAKE) --no-print-directory misra coverage
endif

lint: .venv/tests ## Types, style, imports one way, C warnings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo --no-cache
	CC="$(CC)" tools/c_warnings.sh

coverage: .venv/tests .venv/gates build/extensions ## Branches and conditions (MC/DC) of the C core that the tests reach, against tools/gates/coverage.toml
	$(BIN)/python -m tools.gates.coverage

misra: .venv/tests .venv/gates ## MISRA C:2012 over the C core by cppcheck, against the deviations in tools/gates/misra.toml
	$(BIN)/python -m tools.gates.misra

mutants: .venv/tests build/extensions ## Mutants of the C sources that have changed since build/mutants.json, on the tests of each
	$(BIN)/python -m tests.firmware.mutants.run > build/mutants.log

evidence: .venv/tests .venv/gates build/extensions ## Records of all gates that are quick anew where stale, then one report of all: out/evidence
	$(BIN)/python -m tools.gates.records
	$(BIN)/bms evidence --out out/evidence

proofs: .venv/tests ## What CBMC proves of the C core, for all inputs (tests/firmware/proofs)
	$(BIN)/python tools/long_checks.py proofs

generate: build/extensions ## Write firmware_c/generated anew from preset, model and CAN database
	$(BIN)/python -m codegen

models: build/extensions ## Train the shipped models anew (both presets, lagged too), generate the tables
	for preset in paper_calibrated lin2014; do \
	  $(BIN)/bms train --preset $$preset --out bms/models/$$preset.json || exit 1; \
	  $(BIN)/bms train --preset $$preset --lagged --out bms/models/$${preset}_lagged.json || exit 1; done
	$(BIN)/python -m codegen

verify-tables: build/extensions ## Try all 2^32 arguments of every edge of the shipped models in C (some 10 minutes)
	$(BIN)/bms verify-tables --stride 1

long-checks: .venv/tests build/extensions ## What takes too long for make test (see results/checks.toml) where its inputs have changed; CHECKS=name alone
	$(BIN)/python tools/long_checks.py $(CHECKS)

ifdef TARGET
fuzz: .venv/tests .venv/gates build/extensions ## 10^7 damaged frames, 10^6 damaged logs (SEED=n for others); or libFuzzer: TARGET=session|clock|slcan|image|calibration|logs SECONDS=60
ifeq ($(TARGET),logs)
	mkdir -p build/fuzz
	cd build/fuzz && PYTHONPATH=$(CURDIR) $(CURDIR)/$(BIN)/python -m tests.hil_sim.log_target logs -max_total_time=$(or $(SECONDS),60) -seed=$(or $(SEED),1) -print_final_stats=1
else
	$(BIN)/python -m tests.firmware.fuzz.run $(TARGET) $(or $(SECONDS),60) $(or $(SEED),1)
endif
else
fuzz: fuzz-frames fuzz-logs
endif

fuzz-frames: .venv/tests build/extensions
	$(BIN)/python -m tests.firmware.native.build fuzz --sanitize --out build/native
	build/native/fuzz 10000000 $(or $(SEED),1)

fuzz-logs: .venv/tests build/extensions
	$(BIN)/python -m tests.hil_sim.fuzz_logs 1000000 $(or $(SEED),1)

benchmark: .venv/tests build/extensions ## Time of a control period of the ECU in C, and what dominates it
	$(BIN)/python -m tests.firmware.native.build benchmark --out build/native
	build/native/benchmark 50000

docs: .venv/docs build/extensions page ## The documentation as a site in build/site; a broken link or reference fails
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --site-dir build/site
	$(BIN)/python -m hil_sim.dashboard.site build/site/page
	@echo "build/site/index.html (with search: python3 -m http.server --directory build/site)"

clean: ## Remove everything that set-up, build and runs have made
	rm -rf .venv build out *.egg-info bms/firmware/_firmware.* bms/studies/rivals/_rivals.* hil_sim/native/_native.* hil_sim/studies/campaign/_runner.* hil_sim/studies/pack/_pack.* $(PAGE)/static $(PAGE)/web/node_modules

.venv/runtime: pyproject.toml constraints.txt setup.py
	tools/check_machine.sh "$(PYTHON)"
	test -x $(BIN)/python || "$(PYTHON)" -m venv .venv
	$(INSTALL) setuptools wheel cffi
	$(INSTALL) --no-build-isolation --editable .
	touch $@

.venv/tests: .venv/runtime tools/debian_packages.sh
	tools/debian_packages.sh
	$(INSTALL) --no-build-isolation --editable '.[test]'
	$(INSTALL) --no-deps universalmutator # what it wants beside is for a way of mutating that is not used
	touch $@

# Other systems have other names for these packages; the gates say what is missing.
.venv/gates: .venv/runtime tools/debian_packages.sh
	tools/debian_packages.sh gates || test -z "$$CI"
	touch $@

.venv/docs: .venv/runtime
	$(INSTALL) --no-build-isolation --editable '.[docs]'
	touch $@

build/extensions: .venv/runtime $(C_SOURCES) $(EXTENSION_BUILD)
	$(BIN)/python setup.py --quiet build_ext --inplace --parallel 2
	@mkdir -p build && touch $@

build/page: .venv/runtime $(C_SOURCES) $(PAGE_SOURCES)
	$(INSTALL) --no-build-isolation --editable '.[dashboard,dashboard-build]'
	$(BIN)/python -m hil_sim.dashboard.build
	@mkdir -p build && touch $@

build/sanitized/done: .venv/runtime $(C_SOURCES) $(EXTENSION_BUILD)
	rm -rf build/sanitized
	$(BIN)/python -m bms.native_build --sanitize --out build/sanitized
	touch $@

include firmware_c/firmware.mk
