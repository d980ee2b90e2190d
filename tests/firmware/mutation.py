"""Variants of the firmware's extension with a change in one source: the rest is compiled once."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bms.native_build import FIRMWARE, FLAGS, ROOT, NativeExtension

MODULE_PATH = Path(*FIRMWARE.module.split("."))


@dataclass(frozen=True)
class CompiledFirmware:
    """Objects of the unchanged firmware, from which variants are linked."""

    objects: tuple[Path, ...]
    extension: Path

    @classmethod
    def build(cls, folder: Path, native: NativeExtension = FIRMWARE) -> CompiledFirmware:
        """Compile an extension into a folder and keep its objects."""
        extension = Path(native.builder(tree=ROOT).compile(tmpdir=str(folder)))
        objects = tuple(sorted(folder.rglob("*.o")))
        assert len({path.name for path in objects}) == len(objects)
        return cls(objects, extension)

    def variant(self, source: str, old: str, new: str, out: Path) -> Path:
        """Build folder `out` with `old` replaced by `new` in firmware_c/src/SOURCE."""
        return self.variant_of_changes(source, {old: new}, out)

    def variant_of_changes(self, source: str, changes: Mapping[str, str], out: Path) -> Path:
        """Build folder `out` with each text replaced by its new one in firmware_c/src/SOURCE."""
        text = (ROOT / "firmware_c" / "src" / source).read_text(encoding="utf-8")
        for old, new in changes.items():
            assert old in text, "the mutant no longer applies; bring it up to date"
            text = text.replace(old, new)
        out.mkdir(parents=True)
        mutant = out / source
        mutant.write_text(text, encoding="utf-8")
        compiler = os.environ.get("CC", "gcc")
        includes = [f"-I{ROOT / folder}" for folder in FIRMWARE.folders]
        changed = mutant.with_suffix(".o")
        subprocess.run(
            [compiler, *FLAGS, "-fPIC", *includes, "-c", str(mutant), "-o", str(changed)],
            check=True,
        )
        linked = out / MODULE_PATH.parent / self.extension.name
        linked.parent.mkdir(parents=True)
        others = [str(path) for path in self.objects if path.name != changed.name]
        assert len(others) == len(self.objects) - 1
        command = [compiler, "-shared", *others, str(changed), "-o", str(linked)]
        subprocess.run(command, check=True)
        return out
