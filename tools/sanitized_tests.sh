#!/bin/sh
# The firmware tests once more, against the C core built with address and undefined-behaviour sanitizers, and
# against libraries of ports, boot stage and image checks built with them.
# Left out are the tests that look at sources, or build variants, programs and images of their own: they do not
# run what is built with sanitizers. Libraries and extension have the same tables, which is no violation here.
set -eu
runtime=$(${CC:-gcc} -print-file-name=libasan.so)
LD_PRELOAD=$runtime ASAN_OPTIONS=detect_leaks=0:detect_odr_violation=0 UBSAN_OPTIONS=print_stacktrace=1 BMS_SANITIZE=1 \
  .venv/bin/python -m pytest tests/firmware -n 2 --dist loadfile --firmware-build build/sanitized \
  --ignore tests/firmware/test_mutants.py --ignore tests/firmware/test_structure.py \
  --ignore tests/firmware/test_fuzz.py --ignore tests/firmware/test_fuzz_targets.py --ignore tests/firmware/test_boot.py \
  --ignore tests/firmware/test_budgets.py --ignore tests/firmware/test_ports.py \
  --ignore tests/firmware/test_linux_port.py "$@"
