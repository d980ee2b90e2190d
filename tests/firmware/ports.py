"""Builds of the ports, made by their own rules, for whoever tests images."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PORTS = ROOT / "firmware_c" / "port"
CROSS = "arm-none-eabi-"
IS_CI = "CI" in os.environ
needs_compiler = pytest.mark.skipif(
    shutil.which(f"{CROSS}gcc") is None and not IS_CI,
    reason="not run: gcc-arm-none-eabi is not installed",
)
needs_emulator = pytest.mark.skipif(
    (shutil.which(f"{CROSS}gcc") is None or shutil.which("qemu-system-arm") is None) and not IS_CI,
    reason="not run: gcc-arm-none-eabi or qemu-system-arm is not installed",
)
BOARDS = {"mps2_an385": "mps2-an385", "mps2_an386": "mps2-an386"}


def build(target: str, tree: Path = ROOT) -> Path:
    """Build folder of a port after `make`; CalledProcessError, with its words, when that fails."""
    folder = tree / "build" / "firmware" / target
    folder.mkdir(parents=True, exist_ok=True)
    command = ["make", "-f", f"firmware_c/port/{target}/port.mk", f"PYTHON={sys.executable}"]
    with (folder.parent / f".{target}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # the other worker of the tests may be at it
        subprocess.run(command, cwd=tree, check=True, capture_output=True, text=True)
    return folder


def build_variant(target: str, out: Path, *variables: str, tree: Path = ROOT) -> Path:
    """Folder out/target with a port built with other variables of its rules, or from a tree."""
    folder = out / target
    command = ["make", "-f", f"firmware_c/port/{target}/port.mk", f"BUILD={folder}"]
    command += [f"PYTHON={sys.executable}", *variables]
    subprocess.run(command, cwd=tree, check=True, capture_output=True, text=True)
    return folder


@cache
def built(target: str) -> Path:
    """Folder with the port's present image."""
    return build(target)


@cache
def image(target: str = "mps2_an386") -> bytes:
    """The port's binary."""
    return (built(target) / "firmware.bin").read_bytes()
