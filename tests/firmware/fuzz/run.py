"""Lets libFuzzer look for what breaks a rule of a target.

    python -m tests.firmware.fuzz.run TARGET SECONDS [SEED]

What it finds new stays in build/fuzz/TARGET, from where the next run goes on; an input that breaks
a rule stays there as crash-*, and the exit code is not 0.
"""

from __future__ import annotations

import os
import subprocess
import sys

from bms.native_build import ROOT
from tests.firmware.fuzz.build import CLANG, CORPUS, TARGETS, Builder, has_libfuzzer

OUT = ROOT / "build" / "fuzz"


def main(words: list[str]) -> int:
    """Run a target for some seconds; 2 for words that cannot be used."""
    if len(words) not in (2, 3) or words[0] not in TARGETS or not all(map(str.isdigit, words[1:])):
        print(
            f"fuzz: give TARGET SECONDS [SEED], TARGET one of {', '.join(TARGETS)}", file=sys.stderr
        )
        return 2
    if not has_libfuzzer():
        print(
            f"fuzz: {CLANG} is missing; install it by 'tools/debian_packages.sh gates'",
            file=sys.stderr,
        )
        return 2
    target, seconds, seed = words[0], words[1], words[2] if len(words) > 2 else "1"
    program = Builder(OUT / "programs", libfuzzer=True).program(target)
    found = OUT / target
    found.mkdir(parents=True, exist_ok=True)
    options = [f"-max_total_time={seconds}", f"-seed={seed}", "-max_len=1024", "-timeout=20"]
    options += ["-use_value_profile=1", "-print_final_stats=1", f"-artifact_prefix={found}/"]
    return subprocess.run(
        [str(program), *options, str(found), str(CORPUS / target)],
        env={**os.environ, "ASAN_OPTIONS": "detect_leaks=0"},
        check=False,
    ).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
