"""candump's log and what it shows on a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from hil_sim.logs import LogFrame, Unread
from tests.hil_sim.dialects.dialect import hexed, text


def _log_id(frame: LogFrame) -> str:
    return f"{frame.frame_id:08X}" if frame.is_extended else f"{frame.frame_id:03X}"


def candump_log(
    frames: Sequence[LogFrame],
    has_direction: bool = True,
    channel: str = "can0",
    times: str = "010.6f",
) -> bytes:
    return text(
        [
            f"({frame.time_s:{times}}) {channel} {_log_id(frame)}#{hexed(frame.data, '')}"
            + ((" R" if frame.received else " T") if has_direction else "")
            for frame in frames
        ]
    )


def candump_shown(
    frames: Sequence[LogFrame], has_direction: bool = False, colour: str = ""
) -> bytes:
    """What candump shows on a terminal with -t a, and with -x and -c."""
    off = "\x1b[0m" if colour else ""
    lines = []
    for frame in frames:
        way = ("  RX - -" if frame.received else "  TX - -") if has_direction else ""
        data = f" [{len(frame.data)}]  {hexed(frame.data)}".rstrip()
        line = f" ({frame.time_s:010.6f})  {colour}can0{way}{off}  {_log_id(frame)}  {data}"
        lines.append(line)
    return text(lines)


LOG_FOREIGN = {
    "({time}) can0 123#R": (Unread.REMOTE_FRAMES, 1),
    "({time}) can0 123#R8 R": (Unread.REMOTE_FRAMES, 1),
    "({time}) can0 20000088#0000000000000000": (Unread.ERROR_FRAMES, 1),
    "({time}) can0 20000004#0004000000000000 R": (Unread.ERROR_FRAMES, 1),
    "({time}) can0 123##1AABBCCDDEEFF00112233445566 R": (Unread.CAN_FD_FRAMES, 1),
    "({time}) can0 123##0": (Unread.CAN_FD_FRAMES, 1),
    "({time}) can0 00123#80:00:00000000#1122 R": (Unread.CAN_XL_FRAMES, 1),
    "({time}) can0 300#1122334455667788_9 R": (Unread.LONG_DLC_FRAMES, 1),
    "({time}) can0 300#1122334455667788_F": (Unread.LONG_DLC_FRAMES, 1),
    "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)": (Unread.LOST_FRAMES, 3),
    "DROPCOUNT: dropped 1 CAN frame on 'can0' socket (total drops 4)": (Unread.LOST_FRAMES, 1),
}
SHOWN_FOREIGN = {
    " ({time})  can0  123   [0]  remote request": (Unread.REMOTE_FRAMES, 1),
    " ({time})  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME": (
        Unread.ERROR_FRAMES,
        1,
    ),
    " ({time})  can0  123  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B": (Unread.CAN_FD_FRAMES, 1),
    " ({time})  can0  123  [06]  00 01 02 03 04 05": (Unread.CAN_FD_FRAMES, 1),
    " ({time})  can0  300   {{B}}  11 22 33 44 55 66 77 88": (Unread.LONG_DLC_FRAMES, 1),
}
