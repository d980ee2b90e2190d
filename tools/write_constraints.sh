#!/bin/sh
# Pin what a fresh environment resolves to: one `pip freeze` for each Python line, merged with markers.
#   usage: tools/write_constraints.sh FREEZE_3.10 FREEZE_3.11_OR_NEWER > constraints.txt
set -eu
echo "# Versions that set-up installs; written by tools/write_constraints.sh from two pip freezes."
only() { # only A B MARKER: lines of A that B lacks, with the marker
  grep -vxF -f "$2" "$1" | sed "s/\$/; $3/"
}
{
  grep -xF -f "$1" "$2"
  only "$1" "$2" "python_version < '3.11'"
  only "$2" "$1" "python_version >= '3.11'"
} | sort
