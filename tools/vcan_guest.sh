#!/bin/bash
# Run a command where the CAN interface vcan0 exists: tools/vcan_guest.sh COMMAND [ARGUMENT...]
# The package carries the script that does it, which says more: an installed one has no tools folder.
exec "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/../hil_sim/bus/vcan_guest.sh" "$@"
