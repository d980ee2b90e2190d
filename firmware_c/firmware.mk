# The firmware as images for microcontrollers and as native programs; included by the Makefile.
# The build table: every folder of firmware_c/port with a port.mk has its row here.
FIRMWARE_TARGETS := linux mps2_an385 mps2_an386

COST_TARGETS := mps2_an385 mps2_an386

.PHONY: firmware cost pil three-places

# ACCEPT=1 makes the sizes of this build those that later ones are compared with.
firmware: .venv/firmware ## Images of every port, or of TARGET=name, in build/firmware; sizes against budgets
	for target in $(or $(TARGET),$(FIRMWARE_TARGETS)); do \
	  $(MAKE) --no-print-directory -f firmware_c/port/$$target/port.mk || exit 1; done

cost: .venv/firmware ## Instructions of estimate, decision and control period on emulated Cortex-M; docs/images/cost.png
	for target in $(COST_TARGETS); do \
	  $(MAKE) --no-print-directory -f firmware_c/port/$$target/port.mk build/firmware/$$target/cost.elf || exit 1; done
	$(BIN)/bms cost --out docs/images/cost.png

pil: ## Charge the cell against the Cortex-M4F image in QEMU and write a report to out/pil
	$(MAKE) --no-print-directory firmware TARGET=mps2_an386
	$(BIN)/bms sil --target qemu:mps2-an386 --baseline s-cbf --out out/pil

three-places: .venv/tests ## Hold native process and Cortex-M images against the host, frame by frame; ROWS=pattern of the fault matrix
	$(MAKE) --no-print-directory firmware
	$(BIN)/bms compare-targets $(if $(ROWS),--rows '$(ROWS)')

.venv/firmware: .venv/runtime build/extensions tools/debian_packages.sh
	tools/debian_packages.sh firmware
	touch $@
