#!/bin/sh
# Runs CBMC 6.6 with the arguments given; Debian 12 has none, so that it is taken from Debian 13, unpacked beside the
# C library that it wants, into build/cbmc. Each package is held to its SHA-256.
set -eu
home=$(cd "$(dirname "$0")/.." && pwd)/build/cbmc
pool=http://deb.debian.org/debian/pool/main
packages="
c/cbmc/cbmc_6.6.0-4_amd64.deb 02560859a17049c976961c232c4fc58f0747b57f9b751a466b1f368a438b0e41
m/minisat2/minisat_2.2.1-8_amd64.deb 0b3a870202e022bea8b04d140ded40d9137363566706750b4540518bc0eb63d7
z/zlib/zlib1g_1.3.dfsg+really1.3.1-1+deb13u1_amd64.deb 8c27c342230503b73dfde629642c3b352e87b554e06d60cf58772f236a305ceb
g/glibc/libc6_2.41-12+deb13u5_amd64.deb b59b0625cd1a791375d40dab23a4d5d3d0641e3d0a773501becdc3725b7f99cf
g/gcc-14/libgcc-s1_14.2.0-19_amd64.deb 3c71917b490d1a17aed43196a2787a256ecf060526cdb20216a74bedc061b150
g/gcc-14/libstdc++6_14.2.0-19_amd64.deb ab1fa05837aa7a92aae748fd07a18a35f7d18bb4a71c4724fe2bbf0e32089de0
"
if [ ! -e "$home/done" ]; then
  mkdir -p "$home"
  echo "$packages" | while read -r path sum; do
    [ -n "$path" ] || continue
    file=$home/${path##*/}
    python3 -c 'import sys, urllib.request; urllib.request.urlretrieve(*sys.argv[1:])' "$pool/$path" "$file" || {
      echo "$pool/$path: not there; take the present version and its SHA-256 into tools/cbmc.sh" >&2
      exit 1
    }
    echo "$sum  $file" | sha256sum --check --quiet
    dpkg-deb -x "$file" "$home/root"
  done
  touch "$home/done"
fi
libraries=$home/root/usr/lib/x86_64-linux-gnu
exec "$libraries/ld-linux-x86-64.so.2" --library-path "$libraries:$home/root/usr/lib" "$home/root/usr/bin/cbmc" "$@"
