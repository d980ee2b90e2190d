#!/bin/sh
# The compiler of the coverage gate: counts branches and, of each decision, its conditions (MC/DC).
exec clang-19 "$@" -fprofile-instr-generate -fcoverage-mapping -fcoverage-mcdc -Wno-unused-command-line-argument
