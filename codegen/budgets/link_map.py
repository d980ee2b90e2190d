"""Bytes of flash and RAM by module, from the map file of the GNU linker."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

_START = "Linker script and memory map"
_OUTPUT_SECTION = re.compile(r"^\.(\w+)")
_INPUT_SECTION = re.compile(
    r"^ \.(?P<name>\S+)\s+0x(?P<address>[0-9a-f]+)\s+0x(?P<size>[0-9a-f]+) (?P<file>.+)$"
)
_OBJECT = re.compile(r"firmware_c/(?P<module>.+)\.o$")
_BOOT_STAGE = "boot_image.o"
_WHOLE = re.compile(r"\.ltrans\d+\.ltrans\.o$")
_KINDS = ("text", "rodata", "bss", "data")

FLASH_SECTIONS = ("boot", "application_header", "application", "calibration_header", "calibration")
RAM_SECTIONS = ("bss",)
LIBRARY = "library"
SHARED = "src/shared"
"""What the compiler made for several modules that it optimised as a whole."""


@dataclass(frozen=True)
class Sizes:
    """Module -> bytes. Modules are sources without folder firmware_c and ending."""

    flash: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    ram: dict[str, int] = field(default_factory=lambda: defaultdict(int))


def read_map(path: Path, owners: Mapping[str, str] | None = None) -> Sizes:
    """Sizes of everything that the linker kept, without room for alignment and without the boot
    stage that an application carries, which has a map of its own.

    `owners` gives the module of each function and table of what was optimised as a whole at the
    link, where each has a section; one that it does not name counts for SHARED.
    """
    text = path.read_text(encoding="utf-8").partition(_START)[2]
    # The name of a long section stands alone, with the rest on the next line.
    lines = re.sub(r"^( \.\S+)\n +", r"\1 ", text, flags=re.MULTILINE).splitlines()
    sizes, section = Sizes(), ""
    for line in lines:
        if opened := _OUTPUT_SECTION.match(line):
            section = opened[1]
        place = {
            **dict.fromkeys(FLASH_SECTIONS, sizes.flash),
            **dict.fromkeys(RAM_SECTIONS, sizes.ram),
        }
        if section not in place:
            continue
        found = _INPUT_SECTION.match(line)
        if found and not found["file"].endswith(_BOOT_STAGE):
            module = _module(found["file"], found["name"], owners or {})
            place[section][module] += int(found["size"], 16)
    return sizes


def _module(file: str, section: str, owners: Mapping[str, str]) -> str:
    if _WHOLE.search(file):
        kind, _, name = section.partition(".")
        # The compiler numbers what it copies and the tables inside of functions.
        candidates = (name, name.partition(".")[0])
        return next((owners[n] for n in candidates if kind in _KINDS and n in owners), SHARED)
    found = _OBJECT.search(file)
    return found["module"] if found else LIBRARY
