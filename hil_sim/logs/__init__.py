"""Recordings of a CAN bus in files of several formats, chosen by the file's suffix."""

from hil_sim.logs.formats import FORMATS, LogFormat, log_format, log_suffixes, usable_format
from hil_sim.logs.frame import LogFrame
from hil_sim.logs.reader import read_log
from hil_sim.logs.writer import LogWriter

__all__ = [
    "FORMATS",
    "LogFormat",
    "LogFrame",
    "LogWriter",
    "log_format",
    "log_suffixes",
    "read_log",
    "usable_format",
]
