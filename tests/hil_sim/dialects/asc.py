"""ASC of Vector's tools, BUSMASTER, SavvyCAN and log2asc."""

from __future__ import annotations

from collections.abc import Sequence

from hil_sim.logs import LogFrame, Unread
from tests.hil_sim.dialects.dialect import direction, hexed, text

ASC_HEADER = (
    "date Fri Jun 05 06:24:08.927 AM 2026",
    "base hex  timestamps absolute",
    "no internal events logged",
    "// version 9.0.0",
    "Begin Triggerblock Fri Jun 05 06:24:08.927 AM 2026",
    "   0.000000 Start of measurement",
)
BUSMASTER_HEADER = (
    "date Mon Dec 6 11:21:13 am 2021",
    "base hex  no internal events logged",
    "// version 7.1.0",
)
SAVVYCAN_HEADER = (
    "date Mo. Dez. 06 11:21:13.000 am 2021",
    "base hex  timestamps absolute",
    "no internal event logging",
    "// version 11.0.0",
)


def _asc_id(frame: LogFrame, base: str = "X") -> str:
    return f"{frame.frame_id:{base}}{'x' if frame.is_extended else ''}"


def asc(
    frames: Sequence[LogFrame],
    header: Sequence[str] = ASC_HEADER,
    tail: str = "  Length = 0 BitCount = 0 ID = 256",
    start_s: float = 0.0,
) -> bytes:
    return text(
        [
            *header,
            *(
                f"{frame.time_s + start_s:11.6f} 1  {_asc_id(frame):<15} {direction(frame)}   "
                f"d {len(frame.data):x} {hexed(frame.data)}{tail}"
                for frame in frames
            ),
        ]
    )


def asc_decimal(frames: Sequence[LogFrame]) -> bytes:
    header = ("date Fri Jun 5 06:24:08 2026", "base dec  timestamps absolute")
    lines = [
        f"{frame.time_s:11.6f} 1  {_asc_id(frame, 'd'):<15} {direction(frame)}   "
        f"d {len(frame.data)} " + " ".join(f"{byte:3d}" for byte in frame.data)
        for frame in frames
    ]
    return text([*header, *lines])


def asc_relative(frames: Sequence[LogFrame]) -> bytes:
    """Each time counts from the line before, of whatever kind that is."""
    header = (ASC_HEADER[0], "base hex  timestamps relative", *ASC_HEADER[2:5])
    lines, last_us = ["   0.000000 Start of measurement"], 0
    for frame in frames:
        now_us = round(frame.time_s * 1e6)
        half_us = (now_us - last_us) // 2
        lines.append(f"{half_us / 1e6:11.6f} 1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B 0.1%")
        lines.append(
            f"{(now_us - last_us - half_us) / 1e6:11.6f} 1  {_asc_id(frame)}  {direction(frame)}  "
            f"d {len(frame.data):x} {hexed(frame.data)}"
        )
        last_us = now_us
    return text([*header, *lines])


def asc_canfd(frames: Sequence[LogFrame]) -> bytes:
    """Classical frames in CANFD lines, as log2asc -f and CANoe write them."""
    lines = [
        f"{frame.time_s:11.6f} CANFD   1 {direction(frame):<4} {_asc_id(frame):>11}"
        f"{'':34}0 0 {len(frame.data):x} {len(frame.data):2d} {hexed(frame.data)}"
        f"{'   130000  130        0 0 0 0 0 0'}"
        for frame in frames
    ]
    return text([*ASC_HEADER[:4], *lines])


def asc_canxl(frames: Sequence[LogFrame]) -> bytes:
    """Classical frames in CANXL lines, as log2asc -x writes them."""
    lines = [
        f"{frame.time_s:11.6f} CANXL   1 {direction(frame):<4} "
        f"{'CEFF' if frame.is_extended else 'CBFF'}   984438   4656 {_asc_id(frame):>9}{'':34}"
        f"{len(frame.data):x} {len(frame.data)}"
        f" {hexed(frame.data)} 123123 00000000 00000000 000000050005000e 0000000000a00010"
        for frame in frames
    ]
    return text([*ASC_HEADER[:4], *lines])


_FD_TAIL = "  130000  130     3000 0 0 0 0 0"
ASC_FOREIGN = {
    "{time} 1  123             Rx   r": (Unread.REMOTE_FRAMES, 1),
    "{time} 1  123             Rx   r 8": (Unread.REMOTE_FRAMES, 1),
    "{time} 1  ErrorFrame": (Unread.ERROR_FRAMES, 1),
    "{time} 1  ErrorFrame	Flags = 0x2 CodeExt = 0x20a2": (Unread.ERROR_FRAMES, 1),
    "{time} CANFD   1 Rx   ErrorFrame": (Unread.ERROR_FRAMES, 1),
    "{time} CANFD   1 Rx  123   1 0 9 12 00 01 02 03 04 05 06 07 08 09 0A 0B" + _FD_TAIL: (
        Unread.CAN_FD_FRAMES,
        1,
    ),
    "{time} CANFD   1 Rx  123 AName 1 0 2  2 00 01" + _FD_TAIL: (Unread.CAN_FD_FRAMES, 1),
    "{time} CANFD   1 Rx  123   0 0 4  0  130000 130 10 0 0 0 0 0": (Unread.REMOTE_FRAMES, 1),
    "{time} CANXL   1 Rx   XLFF   984438   4656  123   00 0 1 2 1 1f96 00 0 11 22": (
        Unread.CAN_XL_FRAMES,
        1,
    ),
    "{time} CANXL   1 Rx   FBFF   984438   4656  123   2 2 11 22 8 123123 3000 0": (
        Unread.CAN_FD_FRAMES,
        1,
    ),
    "{time} 1  300             Rx   d 9 11 22 33 44 55 66 77 88": (Unread.LONG_DLC_FRAMES, 1),
    "{time} 1  300             TxRq d 2 11 22": (Unread.TRANSMIT_REQUESTS, 1),
    "{time} 1  Statistic: D 46 R 0 XD 0 XR 0 E 0 O 0 B 2.28%": (Unread.OTHER_ENTRIES, 1),
    "{time} CAN 1 Status:chip status error active": (Unread.OTHER_ENTRIES, 1),
    "{time} 1  J1939TP FEE3p 6 0 0 - Rx d 23 A0 0F A6 60": (Unread.OTHER_ENTRIES, 1),
    "{time} log trigger event": (Unread.OTHER_ENTRIES, 1),
    "{time} L1 3C Rx 2 01 02 checksum = 01": (Unread.OTHER_ENTRIES, 1),
}
