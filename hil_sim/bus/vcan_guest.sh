#!/bin/bash
# Run a command where the CAN interface vcan0 exists.
#
#   vcan_guest.sh COMMAND [ARGUMENT...]
#
# Where the kernel has a vcan0 already, the command simply runs. Elsewhere it runs in a guest:
# Debian's user-mode Linux, an ordinary process that needs neither root nor a hypervisor, with this
# machine's files as its root. Directory, environment, standard output, standard error and exit
# status are the command's own; standard input is empty. The guest has one CPU and no network.
#
# Environment: VCAN_TIMEOUT_S  longest time for the whole run (default 300)
#              VCAN_MEMORY     memory of the guest (default 1G)
#              VCAN_FORCE      not empty: use the guest even where vcan0 exists
#
# Exit status: the command's; 69 without the package, 70 when the guest fails, 64 for wrong use.
#
# This file plays both parts: the kernel of the guest starts it again as process 1.
set -u

KERNEL=/usr/bin/linux.uml
MODULE_ROOT=/usr/lib/uml/modules
MODULES=(net/can/can net/can/can-raw net/can/can-gw drivers/net/can/dev/can-dev drivers/net/can/vcan)

fail() {
    printf 'vcan_guest: %s\n' "$2" >&2
    exit "$1"
}

# --- guest ---------------------------------------------------------------------------------------

load_module() {
    if command -v insmod > /dev/null; then
        insmod "$1"
    else
        # 313 is finit_module on x86-64, which has no wrapper in Python.
        python3 -c 'import ctypes, os, sys
libc = ctypes.CDLL(None, use_errno=True)
file = os.open(sys.argv[1], os.O_RDONLY)
if libc.syscall(313, file, b"", 0):
    sys.exit(os.strerror(ctypes.get_errno()))' "$1"
    fi
}

bring_up_vcan() {
    local module
    for module in "${MODULES[@]}"; do
        # can-dev is built into some kernels.
        [ -e "$MODULE_ROOT/$(uname -r)/kernel/$module.ko" ] || continue
        load_module "$MODULE_ROOT/$(uname -r)/kernel/$module.ko" || return
    done
    ip link set lo up && ip link add vcan0 type vcan && ip link set vcan0 mtu 72 up
}

guest() {
    export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
    mount -t proc proc /proc
    mount -t sysfs sysfs /sys
    mount -t tmpfs tmpfs /dev/shm
    # Pseudo-terminals: the numbers of the host's mean nothing here.
    mkdir -p /dev/pts && mount -t devpts devpts /dev/pts
    # All parties share one CPU: a socket must hold what comes while its owner does not run.
    echo 4194304 > /proc/sys/net/core/rmem_max
    if bring_up_vcan 2> "$VCAN_JOB/failure"; then
        bash "$VCAN_JOB/command" > "$VCAN_JOB/out" 2> "$VCAN_JOB/err" < /dev/null
        echo $? > "$VCAN_JOB/status"
    fi
    sync
    echo o > /proc/sysrq-trigger
    sleep 60
}

# --- host ----------------------------------------------------------------------------------------

# Nothing, or what has to be loaded with a kernel that knows no processor like this one.
preloaded() {
    grep -q -w amx_tile /proc/cpuinfo || return 0
    cc -O2 -shared -fPIC -o "$1/ptrace.so" "${BASH_SOURCE[0]%/*}/vcan_guest_ptrace.c" || return
    printf '%s' "$1/ptrace.so"
}

write_command() {
    # Variables that belong to this shell or this kernel stay outside.
    export -p | grep -v -E '^declare -x (OLDPWD|PWD|SHLVL|_|VCAN_JOB)='
    printf 'cd %q || exit 70\n' "$PWD"
    printf 'exec'
    printf ' %q' "$@"
    printf '\n'
}

host() {
    [ $# -gt 0 ] || fail 64 'usage: vcan_guest.sh COMMAND [ARGUMENT...]'
    if [ -z "${VCAN_FORCE:-}" ] && [ -e /sys/class/net/vcan0 ]; then
        exec "$@"
    fi
    if ! [ -x "$KERNEL" ] || ! [ -d "$MODULE_ROOT" ]; then
        fail 69 'needs user-mode Linux; run: apt-get install -y --no-install-recommends user-mode-linux'
    fi
    command -v ip > /dev/null || fail 69 'needs the command ip; run: apt-get install -y iproute2'

    job=$(mktemp -d /tmp/vcan_guest.XXXXXX) || fail 70 'cannot make a temporary folder'
    uml=
    trap '[ -z "$uml" ] || kill "$uml" 2> /dev/null; rm -rf "$job"' EXIT
    trap 'exit 130' INT
    trap 'exit 143' TERM
    write_command "$@" > "$job/command"
    : > "$job/out"
    : > "$job/err"
    # A copy, because a path with a blank in it cannot be given to the kernel.
    cp "${BASH_SOURCE[0]}" "$job/init" && chmod +x "$job/init"

    local preload
    preload=$(preloaded "$job") || fail 69 'this processor needs the command cc; run: apt-get install -y gcc libc6-dev'
    LD_PRELOAD=$preload timeout -k 5 "${VCAN_TIMEOUT_S:-300}" "$KERNEL" \
        mem="${VCAN_MEMORY:-1G}" rootfstype=hostfs rootflags=/ rw init="$job/init" \
        VCAN_JOB="$job" umid="${job##*/}" uml_dir="$job/" con=null ssl=null quiet \
        < /dev/null > "$job/boot" 2>&1 &
    uml=$!
    tail -q -n +1 -s 0.1 -f --pid="$uml" "$job/err" >&2 &
    local errors=$!
    tail -q -n +1 -s 0.1 -f --pid="$uml" "$job/out"
    wait "$errors"
    wait "$uml"
    local uml_status=$?
    uml=
    if [ -s "$job/status" ]; then
        exit "$(cat "$job/status")"
    fi
    if [ "$uml_status" -eq 124 ]; then
        fail 70 "stopped after ${VCAN_TIMEOUT_S:-300} s; raise VCAN_TIMEOUT_S"
    fi
    fail 70 "the guest did not run the command: $(tail -n 3 "$job/failure" "$job/boot" 2>&1 | tr '\n' ' ')"
}

if [ $$ -eq 1 ] && [ -n "${VCAN_JOB:-}" ]; then
    guest
else
    host "$@"
fi
