"""Compiles the C programs beside this file together with the firmware's own sources."""

from __future__ import annotations

import argparse
import os
import subprocess
from pathlib import Path

from bms.native_build import FLAGS, ROOT, SANITIZERS

HERE = Path(__file__).parent
PARTS = {
    "fuzz": ("fuzz", "damage", "session"),
    "benchmark": ("benchmark", "session"),
    "kernels": ("kernels", "plain_kernels", "plain_family"),
}
WARNINGS = ("-pedantic", "-Wall", "-Wextra", "-Werror")


def build_program(name: str, out: Path, sanitize: bool, tree: Path = ROOT) -> Path:
    """Executable of a program in PARTS around the firmware of tree/firmware_c."""
    firmware = tree / "firmware_c"
    folders = [firmware / folder for folder in ("include", "src", "generated")]
    sources = [HERE / f"{part}.c" for part in PARTS[name]]
    sources += [path for folder in folders for path in sorted(folder.glob("*.c"))]
    out.mkdir(parents=True, exist_ok=True)
    flags = [*FLAGS, *WARNINGS, *(SANITIZERS if sanitize else ())]
    includes = [f"-I{folder}" for folder in (*folders, HERE)]
    compiler = os.environ.get("CC", "gcc")
    subprocess.run(
        [compiler, *flags, *includes, *map(str, sources), "-lm", "-o", str(out / name)], check=True
    )
    return out / name


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", choices=PARTS)
    parser.add_argument("--out", type=Path, required=True, help="folder for the program")
    parser.add_argument("--sanitize", action="store_true", help="address and undefined behaviour")
    arguments = parser.parse_args()
    print(build_program(arguments.name, arguments.out, arguments.sanitize))
