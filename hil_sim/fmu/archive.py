"""A unit as a file: a zip archive that is the same, byte for byte, whenever it is made."""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Mapping
from io import BytesIO
from typing import Any
from uuid import UUID

from jinja2 import Environment, PackageLoader, StrictUndefined

from bms import __version__

FIRST_TIME = (1980, 1, 1, 0, 0, 0)
"""The earliest time that a zip archive can state."""
_MODE = 0o644
_COMPRESSION_LEVEL = 9


def archive(contents: Mapping[str, bytes]) -> bytes:
    """Zip archive of files by their path, in the order of the paths."""
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=_COMPRESSION_LEVEL) as zf:
        for path in sorted(contents):
            entry = zipfile.ZipInfo(path, FIRST_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = _MODE << 16
            zf.writestr(entry, contents[path])
    return buffer.getvalue()


def token_of(contents: Mapping[str, bytes]) -> str:
    """What ties a library to its model description: the same for the same files."""
    digest = hashlib.sha256()
    for path in sorted(contents):
        digest.update(f"{path}\n{len(contents[path])}\n".encode() + contents[path])
    return f"{{{UUID(bytes=digest.digest()[:16])}}}"


def described(template: str, **values: Any) -> bytes:
    """A description in XML from a template in this folder, with everything escaped."""
    environment = Environment(
        loader=PackageLoader("hil_sim.fmu", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(template).render(version=__version__, **values).encode()
