# Arm MPS2 with FPGA image AN386: Cortex-M4 with single-precision floating point.
TARGET := mps2_an386
TARGET_ID := 386
CPU := -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard

include firmware_c/port/cortex_m/rules.mk
