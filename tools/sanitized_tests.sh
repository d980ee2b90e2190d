#!/bin/sh
# The firmware tests once more, against the C core built with address and undefined-behaviour sanitizers.
# Left out are the tests that look at sources, or build variants, libraries and images of their own: they do not
# run the extension that is built with sanitizers.
set -eu
runtime=$(${CC:-gcc} -print-file-name=libasan.so)
LD_PRELOAD=$runtime ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1 \
  .venv/bin/python -m pytest tests/firmware -n 2 --dist loadfile --firmware-build build/sanitized \
  --ignore tests/firmware/test_mutants.py --ignore tests/firmware/test_structure.py \
  --ignore tests/firmware/test_fuzz.py --ignore tests/firmware/test_boot.py \
  --ignore tests/firmware/test_budgets.py --ignore tests/firmware/test_ports.py \
  --ignore tests/firmware/test_linux_port.py --ignore tests/firmware/test_image_check.py \
  --ignore tests/firmware/test_ecu_loop.py --ignore tests/firmware/test_slcan.py "$@"
