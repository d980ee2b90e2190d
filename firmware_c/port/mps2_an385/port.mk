# Arm MPS2 with FPGA image AN385: Cortex-M3, floating point in software.
TARGET := mps2_an385
TARGET_ID := 385
CPU := -mcpu=cortex-m3
# Calls of the floating-point library fill the flash; these make more code around them.
CORE_FLAGS := -fno-ipa-sra -fno-move-loop-invariants -fno-code-hoisting

include firmware_c/port/cortex_m/rules.mk
