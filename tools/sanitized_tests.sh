#!/bin/sh
# The firmware tests once more, against the C core built with address and undefined-behaviour sanitizers.
set -eu
runtime=$(${CC:-gcc} -print-file-name=libasan.so)
LD_PRELOAD=$runtime ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1 \
  .venv/bin/python -m pytest tests/firmware --firmware-build build/sanitized "$@"
