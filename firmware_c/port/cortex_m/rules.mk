# Rules of every microcontroller port: boot stage, application and calibration as one image.
# A port sets TARGET, TARGET_ID and CPU; it may set CORE_FLAGS. Run from the repository's root.
BUILD ?= build/firmware/$(TARGET)
PYTHON ?= .venv/bin/python
CROSS ?= arm-none-eabi-
F := firmware_c
RULES := $(MAKEFILE_LIST)

WARNINGS := -pedantic -Wall -Wextra -Werror -Wconversion -Wdouble-promotion -Wmissing-prototypes
# Without fused multiply-add and errno the same operations give the same bits as on the host.
NUMERICS := -ffp-contract=off -fno-math-errno
# Whoever builds anywhere gets the same bytes.
REPRODUCIBLE := "-ffile-prefix-map=$(CURDIR)=." -g0
SECTIONS := -ffunction-sections -fdata-sections -fcallgraph-info=su
CFLAGS := -std=c99 -Os -mthumb $(CPU) $(WARNINGS) $(NUMERICS) $(REPRODUCIBLE) \
  $(SECTIONS) -MMD \
  -DPORT_TARGET=$(TARGET_ID)u \
  -I$F/include -I$F/src -I$F/generated -I$F/image -I$F/boot -I$F/port -I$F/port/cortex_m
# Of what GCC does to be faster, these make code for these processors longer.
SHORT := -fno-if-conversion -fno-schedule-insns2
# The core is optimised as a whole; not with its calibration, which can be replaced, and not with
# the port around it. What is called once stays a function, so that each module has its size.
WHOLE := $(SHORT) -flto -ffat-lto-objects -fno-inline-functions-called-once
LINK_WHOLE := $(CFLAGS) -flto -flto-partition=one
# Where the processor has no square root: the C library's own, without the wrapper that sets errno.
LDFLAGS := $(CPU) -mthumb -nostartfiles --specs=nano.specs -L$F/linker \
  -Wl,--gc-sections -Wl,--fatal-warnings -Wl,--orphan-handling=error -Wl,--build-id=none \
  -Wl,--defsym=sqrtf=__ieee754_sqrtf

CORE_SOURCES := $(wildcard $F/src/*.c $F/generated/can_*.c)
APPLICATION_SOURCES := $(CORE_SOURCES) $F/generated/calibration_default.c $(wildcard $F/port/*.c) \
  $F/boot/restart.c $(addprefix $F/port/cortex_m/, startup.c memory.c port.c main.c \
  application_header.c calibration_header.c)
BOOT_SOURCES := $F/src/e2e.c $F/src/kan.c $F/generated/can_catalog.c $F/generated/can_db.c \
  $(wildcard $F/image/*.c $F/boot/*.c) $F/port/slcan.c \
  $(addprefix $F/port/cortex_m/, startup.c memory.c boot.c)
APPLICATION_OBJECTS := $(APPLICATION_SOURCES:%.c=$(BUILD)/application/%.o)
CORE_OBJECTS := $(CORE_SOURCES:%.c=$(BUILD)/application/%.o)
BOOT_OBJECTS := $(BOOT_SOURCES:%.c=$(BUILD)/boot/%.o)
PARTS := application_header calibration_header

.PHONY: image budgets
.DELETE_ON_ERROR:

# The build fails when the image needs more than firmware_c/budgets.toml allows.
image: $(BUILD)/firmware.elf $(BUILD)/firmware.hex $(BUILD)/firmware.bin budgets

budgets: $(BUILD)/firmware.elf $(BUILD)/sizes.o
	@"$(PYTHON)" -m codegen.budgets $(BUILD) --target $(TARGET) --cross $(CROSS) $(if $(ACCEPT),--accept)

$(BUILD)/sizes.o: $(wildcard $F/include/*.h)
	@printf '#include "bms.h"\nextern char state[]; char state[sizeof(bms_t)];\n' | \
	  $(CROSS)gcc $(CFLAGS) -x c -c - -o $@

$(CORE_OBJECTS): CFLAGS += $(WHOLE) $(CORE_FLAGS)
# Its loops are not to become calls of the functions that they are.
$(BUILD)/%/port/cortex_m/memory.o: CFLAGS += -fno-tree-loop-distribute-patterns -ffreestanding

$(BUILD)/application/%.o: %.c $(RULES)
	@mkdir -p $(@D)
	@$(CROSS)gcc $(CFLAGS) -c $< -o $@

# Tables end with the model: what would follow them is cut off, and left to larger models.
CALIBRATION := $(BUILD)/application/$F/generated/calibration_default.o
CALIBRATION_SECTION := .rodata.BMS_DEFAULT_CALIBRATION

$(CALIBRATION): $F/generated/calibration_default.c $(RULES)
	@mkdir -p $(@D)
	@$(CROSS)gcc $(CFLAGS) -c $< -o $@
	@$(CROSS)objcopy -O binary -j $(CALIBRATION_SECTION) $@ $(BUILD)/whole_calibration.bin
	@"$(PYTHON)" -m bms.image calibration $(BUILD)/whole_calibration.bin --out $(BUILD)
	@$(CROSS)objcopy --update-section $(CALIBRATION_SECTION)=$(BUILD)/calibration.bin $@

$(BUILD)/boot/%.o: %.c $(RULES)
	@mkdir -p $(@D)
	@$(CROSS)gcc $(CFLAGS) -c $< -o $@

$(BUILD)/boot.elf: $(BOOT_OBJECTS) $F/linker/boot.ld $F/linker/memory.ld $F/linker/ram.ld
	@$(CROSS)gcc $(LDFLAGS) -T boot.ld -Wl,-Map=$(BUILD)/boot.map $(BOOT_OBJECTS) -lm -o $@

$(BUILD)/boot_unsealed.bin: $(BUILD)/boot.elf
	@$(CROSS)objcopy -O binary $< $@

$(BUILD)/boot.bin: $(BUILD)/boot_unsealed.bin
	@"$(PYTHON)" -m bms.image boot $< --out $(BUILD)

$(BUILD)/boot_image.o: $F/port/cortex_m/boot_image.S $(BUILD)/boot.bin
	@$(CROSS)gcc $(CPU) -mthumb -Wa,-I$(BUILD) -c $< -o $@

$(BUILD)/unsealed.elf: $(APPLICATION_OBJECTS) $(BUILD)/boot_image.o $F/linker/application.ld \
  $F/linker/memory.ld $F/linker/ram.ld
	@$(CROSS)gcc $(LINK_WHOLE) $(LDFLAGS) -T application.ld -Wl,-Map=$(BUILD)/firmware.map \
	  $(APPLICATION_OBJECTS) $(BUILD)/boot_image.o -lm -o $@
	@sed -i 's|[^ ]*\(\.ltrans[0-9]*\.ltrans\.o\)|whole\1|' $(BUILD)/firmware.map

# Erased flash reads as ones.
$(BUILD)/unsealed.bin: $(BUILD)/unsealed.elf
	@$(CROSS)objcopy -O binary --gap-fill=0xFF $< $@

$(BUILD)/application_header.bin: $(BUILD)/unsealed.bin
	@"$(PYTHON)" -m bms.image parts $< --out $(BUILD)

$(BUILD)/calibration_header.bin: $(BUILD)/application_header.bin ;

$(BUILD)/firmware.elf: $(BUILD)/unsealed.elf $(PARTS:%=$(BUILD)/%.bin)
	@$(CROSS)objcopy $(foreach part,$(PARTS),--update-section .$(part)=$(BUILD)/$(part).bin) $< $@

$(BUILD)/firmware.bin: $(BUILD)/firmware.elf
	@$(CROSS)objcopy -O binary --gap-fill=0xFF $< $@

$(BUILD)/firmware.hex: $(BUILD)/firmware.elf
	@$(CROSS)objcopy -O ihex $< $@

# Counts instructions; not part of the image.
COST_OBJECTS := $(patsubst %.c,$(BUILD)/application/%.o, \
  $(wildcard $F/src/*.c $F/generated/*.c $F/cost/*.c) $F/port/cortex_m/startup.c $F/port/cortex_m/memory.c)

$(BUILD)/cost.elf: $(COST_OBJECTS) $F/linker/cost.ld $F/linker/ram.ld
	@$(CROSS)gcc $(LINK_WHOLE) $(LDFLAGS) -T cost.ld $(COST_OBJECTS) -lm -o $@

-include $(sort $(APPLICATION_OBJECTS:.o=.d) $(BOOT_OBJECTS:.o=.d) $(COST_OBJECTS:.o=.d))
