"""Recordings of a CAN bus in files of several formats, chosen by the file's suffix."""

from hil_sim.logs.formats import FORMATS, LogFormat, log_format, log_suffixes, usable_format
from hil_sim.logs.frame import LogFrame, Unread
from hil_sim.logs.reader import ALL, Log, Selection, described, read_log
from hil_sim.logs.text import head_command
from hil_sim.logs.writer import LogWriter

__all__ = [
    "ALL",
    "FORMATS",
    "Log",
    "LogFormat",
    "LogFrame",
    "LogWriter",
    "Selection",
    "Unread",
    "described",
    "head_command",
    "log_format",
    "log_suffixes",
    "read_log",
    "usable_format",
]
