# A process of Linux that speaks SocketCAN. SANITIZE=1 ends it at undefined behaviour; GENERATED=folder
# takes what `bms export` has written there, for another model or preset.
TARGET := linux
BUILD ?= build/firmware/$(TARGET)
F := firmware_c
GENERATED ?= $F/generated

CFLAGS := -std=c99 -D_DEFAULT_SOURCE -O2 -ffp-contract=off -fno-math-errno \
  -pedantic -Wall -Wextra -Werror -Wconversion -Wdouble-promotion -Wmissing-prototypes \
  $(if $(SANITIZE),-g -fsanitize=undefined -fno-sanitize-recover=all) \
  -I$F/include -I$F/src -I$(GENERATED) -I$F/port -I$F/port/linux -I$F/image
SOURCES := $(wildcard $F/src/*.c $(GENERATED)/*.c) $F/port/ecu_loop.c \
  $F/image/content.c $F/image/sha256.c $(wildcard $F/port/linux/*.c)
HEADERS := $(wildcard $F/include/*.h $F/src/*.h $(GENERATED)/*.h $F/image/*.h $F/port/*.h \
  $F/port/linux/*.h)

$(BUILD)/bms_ecu: $(SOURCES) $(HEADERS) $(lastword $(MAKEFILE_LIST))
	@mkdir -p $(@D)
	$(CC) $(CFLAGS) $(SOURCES) -lm -o $@
