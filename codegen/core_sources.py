"""The C core as a folder for a firmware project of the user's own."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from importlib.metadata import files
from pathlib import Path

from bms import __version__
from bms.errors import InputError
from bms.firmware.calibration import calibration_block
from bms.model.model_file import KanModel
from bms.native_build import ROOT
from bms.presets import Preset
from codegen.calibration_source import calibration_source
from codegen.can_sources import can_sources
from codegen.rendering import environment, write_files

CHECKSUMS_FILE = "bms_core.sha256"
"""SHA-256 and path of every other file of an export, as `sha256sum -c` reads them."""
_DISTRIBUTION = "kan-rcbf-bms"


def core_sources(preset: Preset, model: KanModel) -> dict[str, bytes]:
    """Path in the folder -> content, by path: headers, sources, licence, README, CMakeLists.txt.

    Raises ModelMismatchError for a stale pair of preset and model, and InputError when the firmware
    refuses a constant of theirs.
    """
    calibration_block(preset, model, compiled_in=False)
    generated = {**can_sources(), **calibration_source(preset, model)}
    contents = {
        **{
            f"{folder}/{path.name}": path.read_bytes()
            for folder in ("include", "src")
            for path in (ROOT / "firmware_c" / folder).glob("*.[ch]")
        },
        **{f"generated/{name}": text.encode() for name, text in generated.items()},
        "LICENSE": _licence().encode(),
    }
    template_data = {
        "preset": preset,
        "model": model,
        "package_version": __version__,
        "firmware_version": _defined(contents["include/bms.h"], "BMS_FIRMWARE_VERSION"),
        "calibration_layout": _defined(contents["include/calibration.h"], "BMS_CALIBRATION_LAYOUT"),
        "sources": sorted(path for path in contents if path.endswith(".c")),
        "headers": [
            (path.removeprefix("include/"), _purpose(contents[path]))
            for path in sorted(contents)
            if path.startswith("include/")
        ],
        "checksums_file": CHECKSUMS_FILE,
    }
    for name, template in (("CMakeLists.txt", "core_cmake.j2"), ("README.md", "core_readme.md.j2")):
        contents[name] = environment().get_template(template).render(template_data).encode()
    lines = [f"{_sha256(contents[path])}  {path}\n" for path in sorted(contents)]
    return dict(sorted({**contents, CHECKSUMS_FILE: "".join(lines).encode()}.items()))


def write_core(folder: Path, contents: Mapping[str, bytes]) -> list[Path]:
    """Write an export, all files or none; in place of an earlier one, but of nothing else.

    Raises InputError when a file that would be replaced was not written by an export or has been
    changed since, and when the folder cannot be written.
    """
    try:
        exported = _checksums(folder / CHECKSUMS_FILE)
        for name in contents:
            path = folder / name
            if name == CHECKSUMS_FILE or not path.is_file():
                continue
            if _sha256(path.read_bytes()) not in (exported.get(name), _sha256(contents[name])):
                raise InputError(
                    f"{path}: is not as 'bms export' has written it, and would be replaced; "
                    "move it away or choose another folder"
                )
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be read ({error.strerror}); choose another folder"
        ) from None
    return write_files(folder, contents)


def _checksums(path: Path) -> dict[str, str]:
    """Path -> SHA-256 of the files of the export that is there; empty without one."""
    if not path.is_file():
        return {}
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines)}


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _defined(header: bytes, name: str) -> int:
    """Value of a #define."""
    match = re.search(rf"^#define {name} (\d+)$", header.decode(), re.MULTILINE)
    assert match is not None, name
    return int(match[1])


def _purpose(header: bytes) -> str:
    """First sentence of the comment that a header begins with."""
    comment = header.decode().removeprefix("/*").partition("*/")[0].replace("\n *", "")
    return re.split(r"\.(?=\s)", " ".join(comment.split()) + " ")[0]


def _licence() -> str:
    """Text of the project's licence, from what is installed."""
    return next(file for file in files(_DISTRIBUTION) or () if file.name == "LICENSE").read_text()
