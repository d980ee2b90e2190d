# Arm MPS2 with FPGA image AN386: Cortex-M4 with single-precision floating point.
TARGET := mps2_an386
TARGET_ID := 386
CPU := -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard
# What follows a family's cell and decides is made for speed, at 1.6 KB of flash.
FAST_SOURCES := soc family_observer family_tables family_windows family_decision

include firmware_c/port/cortex_m/rules.mk
