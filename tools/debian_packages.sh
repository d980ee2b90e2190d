#!/bin/sh
# Installs Debian packages: compiler and emulator of the microcontroller ports with the word firmware, what
# measures coverage and looks for MISRA's rules with the word gates, else all that the tests need, with
# user-mode-linux for a real vcan0, can-utils to read it and Chromium for the page.
# On Debian as root it installs them; elsewhere it names the command, and the tests say what is not run. With
# firmware it then fails, unless compiler and emulator are there in another way than as Debian's packages.
set -eu
packages="gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"
case "${1:-}" in
firmware) ;;
gates) packages="clang-19 llvm-19 libclang-rt-19-dev cppcheck" ;;
*) packages="$packages g++ user-mode-linux can-utils iproute2 chromium" ;;
esac
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
  echo "not installed, run as root: $command" >&2
  [ "${1:-}" != firmware ] || {
    ! command -v dpkg-query && command -v arm-none-eabi-gcc && command -v qemu-system-arm
  } >/dev/null || exit 1
fi
