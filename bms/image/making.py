"""How to make images where this package lies: in a checkout of the project, or installed."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
"""Of the checkout, or of the installed packages."""


def port_name(board: str) -> str:
    """The port of a board, which is what `make` calls it: mps2_an386 for mps2-an386."""
    return board.replace("-", "_")


def make_command(port: str, product: str = "") -> str:
    """Shell command that builds a port, or one product of it, into build/firmware.

    In a checkout it is a target of the Makefile there. An installed package has no Makefile; the
    command takes its C core into the working folder, where the rules of the ports find it.
    """
    if (ROOT / "Makefile").is_file():
        return "make cost" if product == "cost.elf" else f"make firmware TARGET={port}"
    rules = Path("firmware_c") / "port" / port / "port.mk"
    words = ["make", "-f", str(rules), f"PYTHON={sys.executable}"]
    words += [f"build/firmware/{port}/{product}"] if product else []
    copy = "" if rules.is_file() else f"cp -r {shlex.quote(str(ROOT / 'firmware_c'))} . && "
    return copy + shlex.join(words)
