#!/bin/sh
# Says in one line what set-up lacks on this machine: Python 3.10 or newer with venv, and a C compiler.
#   usage: tools/check_machine.sh PYTHON
set -eu
python=$1
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null || {
  echo "set-up: '$python' is not Python 3.10 or newer; name one with 'make PYTHON=/path/to/python3 ...'" >&2
  exit 2
}
"$python" -c 'import venv, ensurepip' 2>/dev/null || {
  echo "set-up: '$python' has no venv module; on Debian run 'apt-get install python3-venv'" >&2
  exit 2
}
command -v "${CC:-cc}" >/dev/null || {
  echo "set-up: no C compiler '${CC:-cc}'; on Debian run 'apt-get install gcc python3-dev'" >&2
  exit 2
}
