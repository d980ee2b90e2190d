"""Compiles mutants, and leaves out those that make the same object as the source or another one."""

from __future__ import annotations

import hashlib
import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from bms.native_build import FIRMWARE, FLAGS, ROOT, NativeExtension
from hil_sim.evidence.kept import mutants_hash
from hil_sim.studies.pack.native_build import PACK
from tests.firmware.mutants.generate import Mutant, mutants_of
from tests.firmware.mutation import CompiledFirmware
from tests.firmware.native_library import FOLDERS

_INCLUDES = [f"-I{ROOT / 'firmware_c' / folder}" for folder in (*FOLDERS, "port/linux", "host")]
_INCLUDES += [f"-I{ROOT / folder}" for folder in PACK.folders]


@dataclass(frozen=True)
class Built:
    """A mutant's source and, where an extension has the source, the folder of that made with it."""

    mutant: Mutant
    source: Path
    extension: Path | None
    native: NativeExtension


@dataclass
class Counts:
    """Mutants that were not tried."""

    not_compiled: int = 0
    same_object: int = 0


@dataclass(frozen=True)
class Factory:
    """Makes mutants that differ, of sources of an extension and of ports."""

    firmware: CompiledFirmware
    out: Path
    native: NativeExtension = FIRMWARE
    seed: str = ""
    counts: Counts = field(default_factory=Counts)

    def built(self, source: str) -> Iterator[Built]:
        """Mutants of a source in the order of the draw; each is there until the next one."""
        seen = {self._object_hash(source, (ROOT / source).read_text(encoding="utf-8"))}
        for mutant in mutants_of(source, ROOT, self.seed):
            digest = self._object_hash(source, mutant.text(ROOT))
            if digest is None:
                self.counts.not_compiled += 1
            elif digest in seen:
                self.counts.same_object += 1
            else:
                seen.add(digest)
                path = self.out / Path(source).name
                linked = self._linked(path.with_suffix(".o"))
                yield Built(mutant, path, linked, self.native)

    def _object_hash(self, source: str, text: str) -> str | None:
        """Hash of the object as the extension has it; None where it does not compile."""
        name = Path(source).name
        self.out.mkdir(parents=True, exist_ok=True)
        (self.out / name).write_text(text, encoding="utf-8")
        command = [os.environ.get("CC", "gcc"), *FLAGS, "-w", "-fPIC", "-D_DEFAULT_SOURCE"]
        command += ["-Werror=implicit-function-declaration"]
        command += [*_INCLUDES, "-c", name, "-o", f"{Path(name).stem}.o"]
        done = subprocess.run(command, cwd=self.out, capture_output=True, check=False)
        if done.returncode != 0:
            return None
        content = (self.out / name).with_suffix(".o").read_bytes()
        return hashlib.sha256(content).hexdigest()

    def _linked(self, changed: Path) -> Path | None:
        others = [str(path) for path in self.firmware.objects if path.name != changed.name]
        if len(others) == len(self.firmware.objects):
            return None
        linked = self.out / Path(*self.native.module.split(".")[:-1]) / self.firmware.extension.name
        linked.parent.mkdir(parents=True, exist_ok=True)
        linked.unlink(missing_ok=True)
        command = [os.environ.get("CC", "gcc"), "-shared", *others, str(changed)]
        subprocess.run([*command, "-o", str(linked)], check=True)
        return self.out


def sources_hash(source: str) -> str:
    """Hash of a source and of the core's headers, on which its mutants rest."""
    return mutants_hash(ROOT, source)


def extension_of(source: str) -> NativeExtension:
    """The extension whose tests try a source's mutants."""
    return PACK if source.startswith("firmware_c/pack") else FIRMWARE
