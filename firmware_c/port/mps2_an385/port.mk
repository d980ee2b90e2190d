# Arm MPS2 with FPGA image AN385: Cortex-M3, floating point in software.
TARGET := mps2_an385
TARGET_ID := 385
CPU := -mcpu=cortex-m3

include firmware_c/port/cortex_m/rules.mk
