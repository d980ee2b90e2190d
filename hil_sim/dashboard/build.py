"""Builds the page into hil_sim/dashboard/static: the WebAssembly module, and the front end by Vite.

    python -m hil_sim.dashboard.build

Needs ziglang from PyPI, and Node.js with npm. Imports no extension, so that it works before any is
built.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
from pathlib import Path

from bms.errors import InputError
from bms.native_build import ROOT
from hil_sim.dashboard.module import compile_module, compile_pack_module, sources

FOLDER = Path(__file__).parent
STATIC = FOLDER / "static"
MODULE, PACK_MODULE = "page.wasm", "pack.wasm"
_WEB = FOLDER / "web"
_MARK = "built-from"
_NOT_SOURCES = ("node_modules", "dist")
REMEDY = "build it with 'make page', which needs Node.js with npm"


def build(out: Path = STATIC) -> None:
    """Write the page to a folder, anew; InputError without a tool, or with its complaint."""
    npm = shutil.which("npm")
    if npm is None:
        raise InputError("no npm, which the page is built with; install Node.js 20 or newer")
    _run([npm, "ci", "--no-audit", "--no-fund", "--prefer-offline"])
    shutil.rmtree(out, ignore_errors=True)
    _run([npm, "run", "build", "--", "--outDir", str(out.resolve()), "--emptyOutDir"])
    compile_module(out / MODULE)
    compile_pack_module(out / PACK_MODULE)
    (out / _MARK).write_text(f"{_sources_hash()}\n", encoding="ascii")


def build_if_needed() -> None:
    """Build the page unless one from the present sources is there; InputError as `build`."""
    try:
        require_page()
    except InputError:
        build()


def require_page(static: Path = STATIC) -> None:
    """Raise InputError where no page has been built, or one from other sources than lie here."""
    mark = static / _MARK
    if not mark.is_file():
        raise InputError(f"{static}: the page is not there; {REMEDY}")
    # A wheel has the page without the sources of its front end.
    if _WEB.is_dir() and mark.read_text(encoding="ascii").strip() != _sources_hash():
        raise InputError(f"{static}: the page was built from other sources; {REMEDY}")


def _sources_hash() -> str:
    digest = hashlib.sha256()
    front_end = [
        path
        for path in sorted(_WEB.rglob("*"))
        if path.is_file() and not set(path.relative_to(_WEB).parts) & set(_NOT_SOURCES)
    ]
    for path in [*sources(), *front_end]:
        digest.update(f"{path.relative_to(ROOT).as_posix()}\n".encode() + path.read_bytes())
    return digest.hexdigest()


def _run(command: list[str]) -> None:
    done = subprocess.run(command, cwd=_WEB, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = f"{done.stdout}\n{done.stderr}".strip()
        raise InputError(f"'{' '.join(command[1:])}' fails in {_WEB}:\n{said}")


if __name__ == "__main__":
    build()
