#!/bin/sh
# Installs the Debian packages that the tests need: user-mode-linux for a real vcan0, can-utils to read it.
# On Debian as root it installs them; elsewhere it names the command, and the tests say what is not run.
set -eu
packages="user-mode-linux can-utils iproute2"
missing=""
for package in $packages; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q "install ok installed" || missing="$missing $package"
done
[ -n "$missing" ] || exit 0
command="apt-get install -y --no-install-recommends$missing"
if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; then
  apt-get update -qq
  DEBIAN_FRONTEND=noninteractive $command >/dev/null
else
  echo "tests: for the runs on a real vcan0 run as root: $command" >&2
fi
