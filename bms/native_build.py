"""Builds extensions of C sources behind cffi (API mode), that of the firmware above all.

The declarations are read from the headers themselves, so that binding and C cannot differ. Every
extension knows the hash of the sources that it was built from. tools/native_extensions.py gives
them to setuptools; `python -m bms.native_build --help` builds variants of the firmware, which
`load_build` puts in the place of the installed one.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from cffi import FFI

from bms.errors import InputError

ROOT = Path(__file__).resolve().parents[1]
"""Where bms, codegen, hil_sim and firmware_c lie: a repository, or a folder of packages."""
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno")
SANITIZERS = (
    "-g",
    "-fsanitize=address,undefined,float-cast-overflow",
    "-fno-sanitize-recover=all",
)

_REMEDY = "make one with 'python -m bms.native_build --tree TREE --out FOLDER'"
_HASH_DECLARATION = "const char *native_source_hash(void);"


@dataclass(frozen=True)
class NativeExtension:
    """An extension module: what is compiled into it, and what Python sees of that.

    `folders` and `headers` are paths in a tree: all C sources of the folders are compiled, and the
    headers, in order, are declared.
    """

    module: str
    folders: tuple[str, ...]
    headers: tuple[str, ...]
    libraries: tuple[str, ...] = ()

    def files(self, tree: Path = ROOT) -> list[Path]:
        """Sources and headers that the extension is made of."""
        return [p for f in self.folders for p in sorted((tree / f).glob("*.[ch]"))]

    def source_hash(self, tree: Path = ROOT) -> str:
        """SHA-256 of names and content of all files, as hexadecimal text."""
        digest = hashlib.sha256()
        for path in self.files(tree):
            digest.update(f"{path.relative_to(tree).as_posix()}\n".encode() + path.read_bytes())
        return digest.hexdigest()

    def builder(self, flags: Sequence[str] = FLAGS, tree: Path | None = None) -> FFI:
        """Builder of the extension from a tree.

        Without a tree it is the repository, with paths relative to it as setuptools wants them.
        """
        home, base = (ROOT, Path()) if tree is None else (tree.resolve(), tree.resolve())
        builder = FFI()
        builder.cdef("\n".join(declarations(home / header) for header in self.headers))
        builder.cdef(_HASH_DECLARATION)
        files = [base / path.relative_to(home) for path in self.files(home)]
        builder.set_source(
            self.module,
            "".join(f'#include "{Path(header).name}"\n' for header in self.headers) + "\n"
            "static const char *native_source_hash(void)\n"
            f'{{\n    return "{self.source_hash(home)}";\n}}\n',
            sources=[str(path) for path in files if path.suffix == ".c"],
            depends=[str(path) for path in files if path.suffix == ".h"],
            include_dirs=[str(base / folder) for folder in self.folders],
            libraries=list(self.libraries),
            extra_compile_args=list(flags),
            extra_link_args=[flag for flag in flags if flag.startswith("-fsanitize")],
        )
        return builder

    def is_stale(self, extension: Any) -> bool:
        """Whether a loaded extension was built from other sources than those that lie here now."""
        built_from: bytes = extension.ffi.string(extension.lib.native_source_hash())
        return built_from.decode() != self.source_hash()

    def find_build(self, folder: Path) -> Path:
        """The extension in a folder that a variant was built into; InputError without one."""
        place = folder.joinpath(*self.module.split("."))
        for suffix in EXTENSION_SUFFIXES:  # those of other Python versions may lie beside it
            path = place.with_name(place.name + suffix)
            if path.is_file():
                return path.resolve()
        raise InputError(f"{folder}: not a build of the firmware; {_REMEDY}")

    def load_build(self, folder: Path) -> None:
        """Put the variant in a folder in the place of the installed extension.

        To be called before anybody imports that. Raises InputError when there is no variant, or it
        cannot be loaded.
        """
        spec = spec_from_file_location(self.module, self.find_build(folder))
        assert spec is not None and spec.loader is not None
        assert self.module not in sys.modules, "too late: another build is loaded already"
        try:
            module = module_from_spec(spec)
            spec.loader.exec_module(module)
        except ImportError as error:
            reason = " ".join(str(error).split())
            raise InputError(f"{folder}: cannot be loaded ({reason}); {_REMEDY}") from None
        sys.modules[self.module] = module


def _core(*folders: str) -> tuple[str, ...]:
    return tuple(f"firmware_c/{folder}" for folder in folders)


CORE_FOLDERS = _core("include", "src", "generated")
CORE_HEADERS = tuple(
    f"firmware_c/include/{name}.h"
    for name in (
        *("kan", "rcbf", "thermal", "soc", "family", "planner", "calibration", "can_frame"),
        *("e2e", "codec", "monitor", "history", "network", "pace", "request", "bms"),
    )
)
FIRMWARE = NativeExtension(
    module="bms.firmware._firmware",
    folders=(*CORE_FOLDERS, *_core("image", "host")),
    headers=(*CORE_HEADERS, *_core("image/image.h", "image/content.h", "host/host.h")),
)


def declarations(header: Path) -> str:
    """What cffi needs of a header: no comments, preprocessor lines or constant objects."""
    text = re.sub(r"/\*.*?\*/", "", header.read_text(encoding="utf-8"), flags=re.DOTALL)
    text = re.sub(r"#ifdef __cplusplus\n.*?#endif\n", "", text, flags=re.DOTALL)
    lines = (line for line in text.splitlines() if not re.match(r"extern|#(?!define \w+ \d)", line))
    return "\n".join(lines)


def main() -> None:
    """Build a variant of the firmware's extension into a folder, beside the installed one."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for the extension")
    parser.add_argument("--tree", type=Path, default=ROOT, help="folder that holds firmware_c")
    parser.add_argument("--sanitize", action="store_true", help="address and undefined behaviour")
    arguments = parser.parse_args()
    flags = (*FLAGS, *SANITIZERS) if arguments.sanitize else FLAGS
    print(FIRMWARE.builder(flags, arguments.tree).compile(tmpdir=str(arguments.out)))


if __name__ == "__main__":
    main()
