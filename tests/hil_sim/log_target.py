"""Lets libFuzzer look for what the readers of logs neither read whole nor refuse in one line.

    python -m tests.hil_sim.log_target FOLDER [OPTION OF LIBFUZZER...]

The first byte of an input is the number of a suffix, the rest a file. The rules are those of
tests/hil_sim/fuzz_logs.py. FOLDER keeps what leads to new branches of the readers; it gets a log of
each dialect to begin with. An input that breaks a rule is written to crash-*.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

from tests.hil_sim.fuzz_logs import Findings, Seed, check, seeds

SUFFIXES = (".log", ".asc", ".csv", ".trc", ".blf")
LONGEST = 4096


def broken_rules(suffix: str, content: bytes, folder: Path) -> list[str]:
    """What is wrong with how a file of that suffix is read; nothing where all is well."""
    path = folder / f"input{suffix}"
    path.write_bytes(content)
    findings = Findings()
    check(Seed("input", suffix, content, ()), path, is_cut=False, findings=findings)
    return findings.wrong


def inputs_to_begin_with(folder: Path) -> dict[str, bytes]:
    """A log of each dialect as an input, by name."""
    return {
        f"{one.name}{one.suffix}".replace("/", " "): bytes([SUFFIXES.index(one.suffix)])
        + one.content
        for one in seeds(folder, with_mdf4=False)
        if one.suffix in SUFFIXES
    }


def main(atheris: ModuleType, kept: Path, options: list[str]) -> None:
    """Let libFuzzer go on until a rule is broken or an option ends it; ends the process."""
    kept.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as name:
        folder = Path(name)
        for seed, content in inputs_to_begin_with(folder).items():
            (kept / seed).write_bytes(content)

        def one(data: bytes) -> None:
            if data:
                wrong = broken_rules(SUFFIXES[data[0] % len(SUFFIXES)], data[1:], folder)
                if wrong:
                    raise AssertionError(wrong[0])

        atheris.Setup([sys.argv[0], str(kept), f"-max_len={LONGEST}", *options], one)
        atheris.Fuzz()


if __name__ == "__main__":
    atheris = importlib.import_module("atheris")
    # The readers have to be imported anew, with what counts their branches put in.
    for module in [name for name in sys.modules if name.startswith(("hil_sim", "tests"))]:
        del sys.modules[module]
    with atheris.instrument_imports(include=["hil_sim.logs"]):
        target = importlib.import_module("tests.hil_sim.log_target")
    target.main(atheris, Path(sys.argv[1]), sys.argv[2:])
