# `make run` and `make test` do all their set-up themselves; see `make help`.
PYTHON ?= python3
OUT ?= out/run
# The matrices here are small: more threads of the linear algebra only wait for each other.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

BIN := .venv/bin
RUNNER := hil_sim/studies/campaign/native
RIVALS := bms/studies/rivals/native
C_PROGRAMS := tests/firmware/native
SOURCES := $(wildcard firmware_c/*/*.[ch] $(RUNNER)/*.[ch] $(RIVALS)/*.[ch]) \
  bms/native_build.py bms/studies/rivals/native_build.py hil_sim/studies/campaign/native_build.py tools/native_extensions.py setup.py
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
C_WARNINGS := -std=c99 -pedantic -Wall -Wextra -Werror -Wconversion -Wdouble-promotion -Wmissing-prototypes
C_INCLUDES := $(addprefix -Ifirmware_c/, include src generated image boot port)

.PHONY: help run test lint generate models verify-tables fuzz benchmark clean
.DEFAULT_GOAL := help

help: ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

run: .venv/runtime ## Charge a cell at 10C over a CAN bus and write a report to out/run
	$(BIN)/bms sil --baseline s-cbf --out $(OUT)

test: .venv/tests build/sanitized/done lint ## Everything that must pass: real vcan, images in QEMU, sanitizers
	@if command -v arm-none-eabi-gcc >/dev/null && command -v qemu-system-arm >/dev/null; then \
	  $(MAKE) --no-print-directory firmware pil; \
	else \
	  echo "not run: make firmware and make pil; they need what tools/debian_packages.sh installs" >&2; test -z "$$CI"; \
	fi
	$(BIN)/python -m pytest -n 2 --dist loadfile
	tools/sanitized_tests.sh

lint: .venv/tests ## Types, style and C warnings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	for source in $(foreach part, src generated image boot port, firmware_c/$(part)/*.c) $(RUNNER)/*.c $(RIVALS)/*.c $(C_PROGRAMS)/*.c; do \
	  $(CC) $(C_WARNINGS) $(C_INCLUDES) -I$(RUNNER) -I$(RIVALS) -I$(C_PROGRAMS) -fsyntax-only $$source || exit 1; done

generate: .venv/runtime ## Write firmware_c/generated anew from preset, model and CAN database
	$(BIN)/python -m codegen

models: .venv/runtime ## Train the shipped models anew (both presets, lagged too), generate the tables
	for preset in paper_calibrated lin2014; do \
	  $(BIN)/bms train --preset $$preset --out bms/models/$$preset.json || exit 1; \
	  $(BIN)/bms train --preset $$preset --lagged --out bms/models/$${preset}_lagged.json || exit 1; done
	$(BIN)/python -m codegen

verify-tables: .venv/runtime ## Try all 2^32 arguments of every edge of the shipped models in C (some 10 minutes)
	$(BIN)/bms verify-tables --stride 1

fuzz: .venv/tests ## 10^7 random and damaged frames through the ECU with sanitizers; SEED=n for others
	$(BIN)/python -m tests.firmware.native.build fuzz --sanitize --out build/native
	build/native/fuzz 10000000 $(or $(SEED),1)

benchmark: .venv/tests ## Time of a control period of the ECU in C, and what dominates it
	$(BIN)/python -m tests.firmware.native.build benchmark --out build/native
	build/native/benchmark 50000

clean: ## Remove everything that set-up, build and runs have made
	rm -rf .venv build out *.egg-info bms/firmware/_firmware.* bms/studies/rivals/_rivals.* hil_sim/studies/campaign/_runner.*

.venv/runtime: pyproject.toml constraints.txt $(SOURCES)
	tools/check_machine.sh $(PYTHON)
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(INSTALL) setuptools wheel cffi
	$(INSTALL) --no-build-isolation --editable .
	touch $@

.venv/tests: .venv/runtime tools/debian_packages.sh
	tools/debian_packages.sh
	$(INSTALL) --no-build-isolation --editable '.[test]'
	touch $@

build/sanitized/done: .venv/tests $(SOURCES)
	rm -rf build/sanitized
	$(BIN)/python -m bms.native_build --sanitize --out build/sanitized
	touch $@

include firmware_c/firmware.mk
