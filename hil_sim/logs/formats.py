"""The log formats by suffix, and what each of them cannot carry.

All of them keep identifier, data and time to the microsecond. Text formats can be compressed by
gzip, which is written with a second suffix, as in can.log.gz.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from bms.errors import InputError

GZIP_SUFFIX = ".gz"


@dataclass(frozen=True)
class LogFormat:
    """A format and its gaps."""

    suffix: str
    is_text: bool = True
    """Whether lines can be counted and the file can be compressed."""
    keeps_direction: bool = True
    """Whether it tells sent from received frames; without that all count as received."""
    keeps_start: bool = True
    """Whether a first frame later than 0 s keeps its time; without that it is read at 0 s, except
    that .blf keeps a wall-clock time to the millisecond."""
    library: str = ""
    """What has to be installed for it, in the extra of the suffix's name."""
    is_reproducible: bool = True
    """Whether equal frames give equal bytes; else the file names the time or place of its
    writing."""


FORMATS = {
    form.suffix: form
    for form in (
        LogFormat(".log"),
        LogFormat(".asc", keeps_start=False, is_reproducible=False),
        LogFormat(".csv", keeps_direction=False),
        LogFormat(".trc", keeps_start=False, is_reproducible=False),
        LogFormat(".blf", is_text=False, keeps_start=False),
        LogFormat(".mf4", is_text=False, library="asammdf", is_reproducible=False),
    )
}


def log_suffixes() -> list[str]:
    """Every suffix that a log can have."""
    text = [form.suffix for form in FORMATS.values() if form.is_text]
    return [*FORMATS, *(suffix + GZIP_SUFFIX for suffix in text)]


def is_compressed(path: Path) -> bool:
    """Whether the name ends like that of a compressed file."""
    return path.suffix.lower() == GZIP_SUFFIX


def log_format(path: Path) -> LogFormat:
    """Format by the suffix of the name; InputError for an unknown one."""
    name = path.with_suffix("") if is_compressed(path) else path
    form = FORMATS.get(name.suffix.lower())
    if form is None or (is_compressed(path) and not form.is_text):
        raise InputError(f"{path}: not the suffix of a log; use one of {', '.join(log_suffixes())}")
    return form


def usable_format(path: Path) -> LogFormat:
    """The same, and its library is installed; InputError when it is not."""
    form = log_format(path)
    if form.library and find_spec(form.library) is None:
        raise InputError(
            f"{path}: this format needs {form.library}; run "
            f"pip install 'kan-rcbf-bms[{form.suffix[1:]}]', or use another suffix"
        )
    return form
