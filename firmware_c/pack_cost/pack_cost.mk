# The programs that count instructions of a pack's control period, of its core and of its ECU, and the one that answers recorded frames,
# for the board with floating point.
# Run from the repository's root: make -f firmware_c/pack_cost/pack_cost.mk build/firmware/mps2_an386/pack_cost.elf
include firmware_c/port/mps2_an386/port.mk

PACK_FLAGS := -I$F/pack -I$F/pack/generated -I$F/pack_ecu -I$F/cost -DBMS_MAX_CELLS=192 -DBMS_MAX_FAMILY_CELLS=1
PACK_OBJECTS := $(patsubst %.c,$(BUILD)/application/%.o, $(wildcard $F/src/*.c $F/generated/*.c $F/pack/*.c) \
  $F/pack_cost/pack_cost.c $F/cost/semihosting.c $F/port/cortex_m/startup.c $F/port/cortex_m/memory.c)

$(BUILD)/application/$F/pack/%.o $(BUILD)/application/$F/pack_cost/%.o: CFLAGS += $(PACK_FLAGS)
$(BUILD)/application/$F/pack/%.o: CFLAGS += $(WHOLE)

$(BUILD)/pack_cost.elf: $(PACK_OBJECTS) $F/pack_cost/pack_cost.ld $F/linker/ram.ld
	@$(CROSS)gcc $(LINK_WHOLE) $(LDFLAGS) -T $F/pack_cost/pack_cost.ld $(PACK_OBJECTS) -lm -o $@

PACK_ECU_OBJECTS := $(patsubst $(BUILD)/application/$F/pack_cost/pack_cost.o,$(BUILD)/application/$F/pack_cost/pack_ecu_cost.o,$(PACK_OBJECTS)) \
  $(patsubst %.c,$(BUILD)/application/%.o,$(wildcard $F/pack/generated/*.c $F/pack_ecu/*.c))

$(BUILD)/application/$F/pack_ecu/%.o: CFLAGS += $(PACK_FLAGS) $(WHOLE)

$(BUILD)/pack_ecu_cost.elf: $(PACK_ECU_OBJECTS) $F/pack_cost/pack_cost.ld $F/linker/ram.ld
	@$(CROSS)gcc $(LINK_WHOLE) $(LDFLAGS) -T $F/pack_cost/pack_cost.ld $(PACK_ECU_OBJECTS) -lm -o $@

ANSWERS_OBJECTS := $(subst /pack_ecu_cost.o,/pack_answers.o,$(PACK_ECU_OBJECTS))

$(BUILD)/pack_answers.elf: $(ANSWERS_OBJECTS) $F/pack_cost/pack_cost.ld $F/linker/ram.ld
	@$(CROSS)gcc $(LINK_WHOLE) $(LDFLAGS) -T $F/pack_cost/pack_cost.ld $(ANSWERS_OBJECTS) -lm -o $@

$(PACK_OBJECTS) $(PACK_ECU_OBJECTS) $(ANSWERS_OBJECTS): $(wildcard $F/pack/*.h $F/pack/generated/*.h $F/pack_ecu/*.h)
