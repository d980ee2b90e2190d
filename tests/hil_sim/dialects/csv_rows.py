"""Comma-separated values of python-can and SavvyCAN."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence

from hil_sim.logs import LogFrame, Unread
from tests.hil_sim.dialects.dialect import direction, text

PYTHON_CAN_HEADER = "timestamp,arbitration_id,extended,remote,error,dlc,data"
SAVVYCAN_COLUMNS = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"


def csv_python_can(
    frames: Sequence[LogFrame], header: Sequence[str] = (PYTHON_CAN_HEADER,), separator: str = ","
) -> bytes:
    rows = [
        separator.join(
            [
                repr(frame.time_s),
                hex(frame.frame_id),
                str(int(frame.is_extended)),
                "0",
                "0",
                str(len(frame.data)),
                b64encode(frame.data).decode(),
            ]
        )
        for frame in frames
    ]
    return text([*(line.replace(",", separator) for line in header), *rows])


def csv_savvycan(
    frames: Sequence[LogFrame],
    header: Sequence[str] = (SAVVYCAN_COLUMNS,),
    has_direction: bool = True,
    truth: tuple[str, str] = ("false", "true"),
) -> bytes:
    rows = []
    for frame in frames:
        way = f"{direction(frame)}," if has_direction else ""
        data = "".join(f"{byte:02X}," for byte in frame.data)
        rows.append(
            f"{round(frame.time_s * 1e6)},{frame.frame_id:08X},{truth[frame.is_extended]},{way}0,"
            f"{len(frame.data)},{data}"
        )
    return text([*header, *rows])


PYTHON_CAN_FOREIGN = {
    "{time},0x123,0,1,0,8,": (Unread.REMOTE_FRAMES, 1),
    "{time},0x0,0,0,1,0,": (Unread.ERROR_FRAMES, 1),
    "{time},0x123,0,0,0,12,AAECAwQFBgcICQoL": (Unread.CAN_FD_FRAMES, 1),
    "{time},0x300,0,0,0,9,ESIzRFVmd4g=": (Unread.LONG_DLC_FRAMES, 1),
}
SAVVYCAN_FOREIGN = {
    "{time_us},00000123,false,Rx,0,12,0,1,2,3,4,5,6,7,8,9,A,B,": (Unread.CAN_FD_FRAMES, 1),
    "{time_us},00000300,false,Rx,0,9,11,22,33,44,55,66,77,88,": (Unread.LONG_DLC_FRAMES, 1),
}
