"""Compiles the fuzz targets: with libFuzzer where clang is, else as programs that read files."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from bms.firmware.calibration import calibration_bytes
from bms.model.pair import load_pair
from bms.native_build import FLAGS, ROOT, SANITIZERS

HERE = Path(__file__).parent
CORPUS = HERE / "corpus"
FAMILY = "a123_26650_10C"
CLANG = "clang-19"
WARNINGS = ("-pedantic", "-Wall", "-Wextra", "-Werror")
_FOLDERS = ("include", "src", "generated", "image", "port")


@dataclass(frozen=True)
class Target:
    """Sources of a target: beside this file, of the programs in native, and of the core."""

    here: tuple[str, ...]
    native: tuple[str, ...] = ()
    core: tuple[str, ...] = ("src/*.c", "generated/*.c")


TARGETS: Mapping[str, Target] = MappingProxyType(
    {
        "session": Target(("session_target", "watch"), ("session",)),
        "clock": Target(
            ("clock_target", "watch"), ("session",), ("src/*.c", "generated/*.c", "port/ecu_loop.c")
        ),
        "slcan": Target(("slcan_target",), core=("port/slcan*.c", "port/ring.c")),
        "image": Target(("image_target",), core=("src/*.c", "generated/*.c", "image/*.c")),
        "calibration": Target(("calibration_target", "watch"), ("session",)),
    }
)


@dataclass(frozen=True)
class Change:
    """A text in a source of firmware_c replaced by another one."""

    source: str
    old: str
    new: str


def has_libfuzzer() -> bool:
    """Whether the compiler of the gates is here, which brings libFuzzer."""
    return shutil.which(CLANG) is not None


class Builder:
    """Builds targets into a folder; what several of them share is compiled once."""

    def __init__(self, out: Path, libfuzzer: bool) -> None:
        self._out, self._libfuzzer = out, libfuzzer
        self._compiled_here: set[Path] = set()
        out.mkdir(parents=True, exist_ok=True)
        content = calibration_bytes(*load_pair(FAMILY, None))
        numbers = ", ".join(map(str, content))
        text = '#include "family_calibration.h"\n'
        text += f"const unsigned char FAMILY_CALIBRATION[] = {{ {numbers} }};\n"
        text += "const size_t FAMILY_CALIBRATION_BYTES = sizeof FAMILY_CALIBRATION;\n"
        self._family = out / "family_calibration.c"
        self._family.write_text(text, encoding="ascii")

    def program(self, name: str, change: Change | None = None) -> Path:
        """Executable of a target around the core, or around one with a change."""
        target, firmware = TARGETS[name], ROOT / "firmware_c"
        sources = [HERE / f"{part}.c" for part in target.here]
        sources += [HERE.parent / "native" / f"{part}.c" for part in target.native]
        sources += [path for glob in target.core for path in sorted(firmware.glob(glob))]
        sources.append(self._family)
        if not self._libfuzzer:
            sources.append(HERE / "replay.c")
        objects = [str(self._object(source)) for source in sources]
        program = self._out / name
        if change is not None:
            changed = firmware / change.source
            text = changed.read_text(encoding="utf-8")
            assert change.old in text, "the change no longer applies; bring it up to date"
            broken = self._out / "broken" / changed.name
            broken.parent.mkdir(exist_ok=True)
            broken.write_text(text.replace(change.old, change.new), encoding="utf-8")
            objects[sources.index(changed)] = str(self._compiled(broken, broken.with_suffix(".o")))
            program = broken.with_suffix("")
        command = [*self._compiler(), *SANITIZERS, *self._fuzzer(link=True), *objects, "-lm"]
        subprocess.run([*command, "-o", str(program)], check=True)
        return program

    def _object(self, source: Path) -> Path:
        # Sources of different folders may have the same name. Programs are built in one go: what an
        # earlier process left may be of other sources.
        compiled = self._out / f"{source.parent.name}-{source.stem}.o"
        if compiled not in self._compiled_here:
            self._compiled_here.add(self._compiled(source, compiled))
        return compiled

    def _compiled(self, source: Path, compiled: Path) -> Path:
        includes = [f"-I{ROOT / 'firmware_c' / folder}" for folder in _FOLDERS]
        includes += [f"-I{folder}" for folder in (HERE, HERE.parent / "native", self._out)]
        warnings = () if "broken" in compiled.parts else WARNINGS
        command = [*self._compiler(), *FLAGS, *warnings, *SANITIZERS, *self._fuzzer(link=False)]
        subprocess.run([*command, *includes, "-c", str(source), "-o", str(compiled)], check=True)
        return compiled

    def _compiler(self) -> list[str]:
        return [CLANG if self._libfuzzer else os.environ.get("CC", "gcc")]

    def _fuzzer(self, link: bool) -> list[str]:
        if not self._libfuzzer:
            return []
        return ["-fsanitize=fuzzer" if link else "-fsanitize=fuzzer-no-link"]


def corpus_of(name: str) -> list[Path]:
    """The corpus of a target."""
    return sorted((CORPUS / name).iterdir())
