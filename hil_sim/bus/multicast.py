"""udp_multicast: a bus is one group, whatever else runs on the machine.

python-can listens on one port for all groups. Linux hands such a socket what comes for any group
that any program on the machine has joined, so that two simulations side by side would hear each
other's frames.
"""

from __future__ import annotations

import os
import socket
import sys

import can

# Of linux/in.h and linux/in6.h; Python 3.11's socket does not name them.
_IP_MULTICAST_ALL = 49
_IPV6_MULTICAST_ALL = 29
_OWN_GROUP_ONLY = {
    socket.AF_INET: (socket.IPPROTO_IP, _IP_MULTICAST_ALL),
    socket.AF_INET6: (socket.IPPROTO_IPV6, _IPV6_MULTICAST_ALL),
}
_MOST_EARLIER = 10_000


def keep_to_own_group(bus: can.BusABC) -> None:
    """Hear from now on what is sent to the bus's own group, and forget what came before.

    Raises OSError where the kernel refuses. Other systems than Linux deliver so by themselves.
    """
    if sys.platform != "linux":
        return
    with socket.socket(fileno=os.dup(bus.fileno())) as listening:
        listening.setsockopt(*_OWN_GROUP_ONLY[listening.family], 0)
        for _ in range(_MOST_EARLIER):
            try:
                listening.recv(1, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
