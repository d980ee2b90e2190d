#!/bin/sh
# One charge and the fault matrix, for a pipeline. Exit code 1 when a limit is crossed or a row is red.
#   usage: charge_and_faults.sh OUT [options of 'bms fault-matrix', for example --rows 'lost once']
# Leaves OUT/charge (report, summary.json, log) and OUT/faults (page, JSON, junit.xml).
set -u
out=${1:?"usage: charge_and_faults.sh OUT [options of 'bms fault-matrix']"}
shift
status=0
bms sil --out "$out/charge" || status=$?
bms fault-matrix "$@" --out "$out/faults" || status=$?
exit "$status"
