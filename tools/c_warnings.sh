#!/bin/sh
# Warnings as errors over every C source: the host's by CC, those of microcontroller ports by their own compiler.
set -eu
flags="-std=c99 -pedantic -Wall -Wextra -Werror -Wconversion -Wdouble-promotion -Wmissing-prototypes -fsyntax-only"
native=hil_sim/native runner=hil_sim/studies/campaign/native rivals=bms/studies/rivals/native programs=tests/firmware/native pack=hil_sim/studies/pack/native
page=hil_sim/dashboard/native
includes=""
for part in include src generated image boot port host pack pack/generated pack_ecu cost; do includes="$includes -Ifirmware_c/$part"; done

for source in firmware_c/src/*.c firmware_c/generated/*.c firmware_c/image/*.c firmware_c/boot/*.c firmware_c/port/*.c \
  firmware_c/host/*.c firmware_c/pack/*.c firmware_c/pack/generated/*.c firmware_c/pack_ecu/*.c "$native"/*.c "$runner"/*.c "$pack"/*.c "$rivals"/*.c "$page"/*.c "$programs"/*.c; do
  ${CC:-cc} $flags $includes -I"$native" -I"$runner" -I"$pack" -I"$rivals" -I"$page" -I"$programs" "$source"
done
for source in tests/firmware/fuzz/*.c; do
  ${CC:-cc} $flags $includes -I"$programs" -Itests/firmware/fuzz "$source"
done
for source in firmware_c/port/linux/*.c hil_sim/bus/*.c; do # the operating system's own interface is beyond C99
  ${CC:-cc} $flags -D_DEFAULT_SOURCE $includes "$source"
done
if command -v arm-none-eabi-gcc >/dev/null; then
  for source in firmware_c/port/cortex_m/*.c firmware_c/cost/*.c firmware_c/pack_cost/*.c; do
    arm-none-eabi-gcc $flags -mthumb -mcpu=cortex-m4 -DPORT_TARGET=0u $includes -Ifirmware_c/port/cortex_m "$source"
  done
else
  echo "not run: warnings of firmware_c/port/cortex_m and cost; arm-none-eabi-gcc is not installed" >&2
  test -z "${CI:-}"
fi
