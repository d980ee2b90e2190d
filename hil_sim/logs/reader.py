"""Reading of logs with python-can's readers, whose exceptions become one clear line.

What a bus of this project does not show is not read either: remote, error and CAN FD frames.
"""

from __future__ import annotations

import gzip
import logging
import math
from collections.abc import Iterator
from contextlib import ExitStack
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import can
from can.io.player import MESSAGE_READERS

from bms.errors import InputError
from hil_sim.bus.limits import HIGHEST_EXTENDED_ID, HIGHEST_STANDARD_ID, MAX_DATA_LENGTH
from hil_sim.logs.formats import LogFormat, is_compressed, usable_format
from hil_sim.logs.frame import LogFrame

# What the libraries have to say about a file is in their exceptions already.
for _library in ("can", "asammdf"):
    logging.getLogger(_library).addHandler(logging.NullHandler())


def read_log(path: Path) -> Iterator[LogFrame]:
    """The data frames of a log in their order.

    Raises InputError in one line for a log that is missing, unreadable, cut off, empty or not in
    the order of time.
    """
    last_s = -math.inf
    for number, message in enumerate(_messages(path, usable_format(path)), start=1):
        if message.is_remote_frame or message.is_error_frame or message.is_fd:
            continue
        frame = _checked(path, number, message)
        if frame.time_s < last_s:
            raise InputError(
                f"{path}: frame {number}: time goes back from {last_s:.6f} s to "
                f"{frame.time_s:.6f} s; the log was reordered, record it again"
            )
        last_s = frame.time_s
        yield frame
    if last_s == -math.inf:
        raise InputError(f"{path}: empty, there is no data frame in it; record it again")


def _checked(path: Path, number: int, message: can.Message) -> LogFrame:
    highest_id = HIGHEST_EXTENDED_ID if message.is_extended_id else HIGHEST_STANDARD_ID
    data = bytes(message.data)
    if not (
        math.isfinite(message.timestamp)
        and 0 <= message.arbitration_id <= highest_id
        and len(data) <= MAX_DATA_LENGTH
        and len(data) == message.dlc
    ):
        raise InputError(
            f"{path}: frame {number}: no CAN frame has such a time, identifier or length; "
            "the file is damaged, record it again"
        )
    time_s = round(message.timestamp, 6) + 0.0  # no negative zero
    return LogFrame(
        time_s, message.arbitration_id, data, message.is_extended_id, bool(message.is_rx)
    )


def _messages(path: Path, form: LogFormat) -> Iterator[can.Message]:
    lines: _Lines | None = None
    try:
        with ExitStack() as stack:
            file: Any = stack.enter_context(path.open("rb"))
            if not file.peek().startswith(form.magic):
                raise ValueError("it begins otherwise")
            if is_compressed(path):
                file = stack.enter_context(gzip.GzipFile(fileobj=file))
            if form.is_text:
                lines = _Lines(stack.enter_context(TextIOWrapper(file, encoding="utf-8")))
            source: Any = lines or file
            reader: Any = MESSAGE_READERS[form.suffix](source)
            if form.suffix == ".blf" and reader.file_size > path.stat().st_size:
                raise EOFError
            yield from reader
    except EOFError:
        raise InputError(f"{path}: cut off at the end; record it again") from None
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; give the path of a log") from None
    except Exception as error:  # the readers are not made for damaged files and raise anything
        where = f"line {lines.number}: " if lines is not None and lines.number else ""
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(
            f"{path}: {where}cannot be read as '{form.suffix}' ({reason}); "
            "give a log of that format"
        ) from None


class _Lines:
    """A text file that knows how far it was read, and whether its last line is whole."""

    def __init__(self, file: TextIOWrapper) -> None:
        self._file = file
        self.number = 0

    def __iter__(self) -> _Lines:
        return self

    def __next__(self) -> str:
        line = next(self._file)
        self.number += 1
        if not line.endswith("\n"):
            raise EOFError
        return line

    def close(self) -> None:
        self._file.close()
