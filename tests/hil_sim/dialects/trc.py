"""PEAK's TRC."""

from __future__ import annotations

from collections.abc import Sequence

from hil_sim.logs import LogFrame, Unread
from tests.hil_sim.dialects.dialect import direction, hexed, text

_TRC_HEADERS = {
    "1.0": (";" + 60 * "#", ";   C:\\TraceFile.trc", ";   PCAN-Net: N/A"),
    "1.1": (";$FILEVERSION=1.1", ";$STARTTIME=44000.5", ";"),
    "1.2": (";$FILEVERSION=1.2", ";$STARTTIME=44000.5", ";"),
    "1.3": (";$FILEVERSION=1.3", ";$STARTTIME=44000.5", ";"),
    "2.0": (";$FILEVERSION=2.0", ";$STARTTIME=44000.5", ";$COLUMNS=N,O,T,I,d,l,D"),
    "2.1": (";$FILEVERSION=2.1", ";$STARTTIME=44000.5", ";$COLUMNS=N,O,T,B,I,d,R,L,D"),
}
TRC_LINES = {
    "1.0": "{n:6d}) {time} {id:>8} {length}  {data}",
    "1.1": "{n:6d}) {time}  {way}  {id:>8}  {length}  {data}",
    "1.2": "{n:6d}) {time} 1  {way}  {id:>8}  {length}  {data}",
    "1.3": "{n:6d}) {time} 1  {way}  {id:>8} -  {length}    {data}",
    "2.0": "{n:7d} {time} DT {id:>8} {way} {length}  {data}",
    "2.1": "{n:7d} {time} DT  1 {id:>8} {way} -  {length}    {data}",
}


def trc(frames: Sequence[LogFrame], version: str) -> bytes:
    lines = [
        TRC_LINES[version]
        .format(
            n=number,
            time=f"{frame.time_s * 1e3:13.3f}",
            id=f"{frame.frame_id:08X}" if frame.is_extended else f"{frame.frame_id:04X}",
            way=direction(frame),
            length=len(frame.data),
            data=hexed(frame.data),
        )
        .rstrip()
        for number, frame in enumerate(frames, start=1)
    ]
    return text([*_TRC_HEADERS[version], *lines], end="\r\n")


TRC_FOREIGN = {
    "1.0": {
        "  2) {time_ms} 0123 3 RTR": (Unread.REMOTE_FRAMES, 1),
        "  2) {time_ms} 0008 4 ERROR 00 19 08 08": (Unread.ERROR_FRAMES, 1),
        "  2) {time_ms} FFFFFFFF 4 00 00 00 04 -- -- -- -- BUSLIGHT": (Unread.OTHER_ENTRIES, 1),
        "  2) {time_ms} 0300 9 11 22 33 44 55 66 77 88": (Unread.LONG_DLC_FRAMES, 1),
    },
    "1.1": {
        "  2) {time_ms} Rx 0123 3 RTR": (Unread.REMOTE_FRAMES, 1),
        "  2) {time_ms} Warng FFFFFFFF 4 00 00 00 08 BUSHEAVY": (Unread.OTHER_ENTRIES, 1),
        "  2) {time_ms} Error 0008 4 00 19 08 08": (Unread.ERROR_FRAMES, 1),
    },
    "2.0": {
        "  2 {time_ms} RR 0123 Rx 3": (Unread.REMOTE_FRAMES, 1),
        "  2 {time_ms} FB 0123 Rx 12 00 01 02 03 04 05 06 07 08 09 0A 0B": (
            Unread.CAN_FD_FRAMES,
            1,
        ),
        "  2 {time_ms} ST Rx 00 00 00 08": (Unread.OTHER_ENTRIES, 1),
        "  2 {time_ms} ER Rx 04 00 02 00 00": (Unread.ERROR_FRAMES, 1),
    },
}
