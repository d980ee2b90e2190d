"""Truncated, bit-flipped and spliced logs for every reader.

    python -m tests.hil_sim.fuzz_logs COUNT [SEED]

A log of each dialect is damaged COUNT times in all and read. It has to be refused in one line, or
read within the time, with every entry accounted for that a second, simpler counter finds; and what
was merely cut off has to give the first of the frames. Exit code 1 and the input's path when not.
"""

from __future__ import annotations

import faulthandler
import gzip
import random
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from bms.errors import InputError
from hil_sim.logs import LogFrame, LogWriter, read_log
from hil_sim.logs.frame import Entry, UnreadableError
from hil_sim.logs.mdf4 import decoded
from tests.hil_sim.dialects import DIALECTS
from tests.hil_sim.dialects.blf import blf_content, blf_of_content
from tests.hil_sim.log_counters import COUNTERS

LONGEST_S = 2.0
_WATCHDOG_S = 30.0
_MDF4_SHARE = 0.01
_MDF4_BATCH = 100
_INTERNALS = (
    "NoneType",
    "object has no",
    "invalid literal for",
    "to unpack",
    "codec can't",
    "Traceback",
)
"""What Python says of itself; a refusal speaks of the log."""

FRAMES = tuple(
    LogFrame(
        round(0.1 * (n // 3), 6),
        (0x100, 0x7FF, 0x18FEF100)[n % 3],
        bytes((37 * n + k) % 256 for k in range(n % 9)),
        is_extended=n % 3 == 2,
        received=n % 2 == 0,
    )
    for n in range(12)
)


@dataclass(frozen=True)
class Seed:
    """An intact log and its frames."""

    name: str
    suffix: str
    content: bytes
    frames: tuple[LogFrame, ...]


@dataclass
class Findings:
    """What came of the inputs, by format and outcome, and a line for each that is wrong."""

    outcomes: Counter[tuple[str, str]] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    slowest_s: float = 0.0


def seeds(folder: Path, with_mdf4: bool) -> list[Seed]:
    """A log of each dialect with foreign entries at its end, compressed ones, and an MDF 4."""
    result = []
    for name, dialect in DIALECTS.items():
        content = dialect.write(FRAMES)
        time_s = FRAMES[-1].time_s
        for line in dialect.foreign:
            entry = line.format(
                time=f"{time_s:.6f}", time_ms=f"{1e3 * time_s:.3f}", time_us=round(1e6 * time_s)
            )
            content += entry.encode() + b"\n"
        result.append(_seed(folder, name, dialect.suffix, content))
        if dialect.suffix != ".blf":
            packed = gzip.compress(content, mtime=0)
            result.append(_seed(folder, f"{name}, gzip", f"{dialect.suffix}.gz", packed))
    if with_mdf4:
        path = folder / "seed.mf4"
        with LogWriter(path) as writer:
            for frame in FRAMES:
                writer.write(frame)
        result.append(Seed("MDF 4", ".mf4", path.read_bytes(), FRAMES))
    return result


def _seed(folder: Path, name: str, suffix: str, content: bytes) -> Seed:
    path = folder / f"seed{suffix}"
    path.write_bytes(content)
    return Seed(name, suffix, content, read_log(path).frames)


# --- Damage --------------------------------------------------------------------------------------


def truncated(rng: random.Random, content: bytes, others: Sequence[bytes]) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def flipped(rng: random.Random, content: bytes, others: Sequence[bytes]) -> bytes:
    damaged = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 8)) if damaged else 0):
        damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def spliced(rng: random.Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """A part replaced by a part of this log or of another, of another length."""
    other = rng.choice((content, rng.choice(others)))
    a, b = (rng.randrange(len(content) + 1) for _ in range(2))
    if rng.random() < 0.5:
        b = min(a + rng.randrange(64), len(content))
    c = rng.randrange(len(other) + 1)
    return content[:a] + other[c : c + rng.randrange(200)] + content[b:]


def lined(rng: random.Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """Lines left out, repeated or put elsewhere."""
    lines = content.splitlines(keepends=True) or [b""]
    at, to = rng.randrange(len(lines)), rng.randrange(len(lines))
    other = rng.choice(others).splitlines(keepends=True) or [b""]
    new = rng.choice(([], [lines[to]], [rng.choice(other)]))
    return b"".join([*lines[:at], *new, *lines[at + rng.randrange(2) :]])


_DAMAGES = (truncated, flipped, spliced, lined)


def damaged(rng: random.Random, seed: Seed, others: Sequence[Seed]) -> tuple[bytes, bool]:
    """A damaged log, and whether it was merely cut off."""
    damage = rng.choice(_DAMAGES)
    inside = rng.random() < 0.5
    if inside and seed.suffix.endswith(".gz"):
        plain = [gzip.decompress(other.content) for other in others]
        content = gzip.compress(damage(rng, gzip.decompress(seed.content), plain), 1, mtime=0)
    elif inside and seed.suffix == ".blf" and seed.name != "BLF without containers":
        objects = blf_content(seed.content)
        method, size = rng.choice((0, 2, 2, rng.randrange(10))), rng.choice((100, 1 << 17))
        inner = damage(rng, objects, [objects])
        content = blf_of_content(seed.content, inner, method, size)
    else:
        content = damage(rng, seed.content, [other.content for other in others])
    return content, damage is truncated


# --- Checks --------------------------------------------------------------------------------------


def check(seed: Seed, path: Path, is_cut: bool, findings: Findings) -> None:
    """Read one damaged log and hold what comes of it against the rules."""
    started_s = time.process_time()
    faulthandler.dump_traceback_later(_WATCHDOG_S, exit=True, file=sys.__stderr__)
    try:
        log = read_log(path)
    except InputError as refused:
        outcome, faults = "refused", list(_faults_of_refusal(path, str(refused)))
    except Exception as error:
        outcome, faults = "crashed", [f"{type(error).__name__}: {error}"]
    else:
        outcome = "read"
        accounted = len(log.frames) + sum(log.unread.values())
        faults = list(_faults_of_reading(seed, path, is_cut, list(log.frames), accounted))
    finally:
        faulthandler.cancel_dump_traceback_later()
    taken_s = time.process_time() - started_s
    findings.slowest_s = max(findings.slowest_s, taken_s)
    if taken_s > LONGEST_S:
        faults.append(f"takes {taken_s:.1f} s")
    _note(findings, seed, path, outcome, faults)


def _note(findings: Findings, seed: Seed, path: Path, outcome: str, faults: list[str]) -> None:
    findings.outcomes[seed.suffix, outcome] += 1
    for fault in faults:
        kept = Path(f"fuzz-{len(findings.wrong)}{seed.suffix}").resolve()
        kept.write_bytes(path.read_bytes())
        findings.wrong.append(f"{seed.name}: {fault}; see {kept}")


def _faults_of_refusal(path: Path, text: str) -> Iterator[str]:
    if len(text.splitlines()) != 1 or not text.startswith(f"{path}: ") or ";" not in text:
        yield f"the refusal is not one line with path and remedy: {text!r}"
    for internal in _INTERNALS:
        if internal in text:
            yield f"the refusal speaks of Python: {text!r}"


def _faults_of_reading(
    seed: Seed, path: Path, is_cut: bool, frames: list[LogFrame], accounted: int
) -> Iterator[str]:
    there = COUNTERS[seed.suffix.removesuffix(".gz")](_plain(path))
    if accounted not in there:
        yield f"{accounted} entries are accounted for, {there} are there"
    if is_cut and frames != list(seed.frames[: len(frames)]):
        yield "the frames of a log that is cut off are not its first ones"
    times_s = [frame.time_s for frame in frames]
    if times_s != sorted(times_s):
        yield "times go back"


def _plain(path: Path) -> bytes:
    content = path.read_bytes()
    return gzip.decompress(content) if path.suffix == ".gz" else content


# --- MDF 4, in its process -----------------------------------------------------------------------


def check_mdf4(seed: Seed, paths: Sequence[tuple[Path, bool]], findings: Findings) -> None:
    """The same for logs that asammdf reads; one process reads several, until one ends it."""
    waiting = list(paths)
    while waiting:
        names = [str(path) for path, _ in waiting]
        command = [sys.executable, "-m", "hil_sim.logs.mdf4_worker", *names]
        done = subprocess.run(command, capture_output=True, check=False)
        answers = done.stdout.splitlines()
        for (path, is_cut), answer in zip(waiting, answers):
            _check_mdf4_answer(seed, path, is_cut, answer, findings)
        if len(answers) < len(waiting):
            _note(findings, seed, waiting[len(answers)][0], "ended the process", [])
        waiting = waiting[len(answers) + 1 :]


def _check_mdf4_answer(
    seed: Seed, path: Path, is_cut: bool, answer: bytes, findings: Findings
) -> None:
    try:
        entries: list[Entry] = [entry for _, entry in decoded(answer)]
    except UnreadableError as refused:
        faults = [f"speaks of Python: {refused}" for text in _INTERNALS if text in str(refused)]
        _note(findings, seed, path, "refused", faults)
        return
    frames = [
        LogFrame(round(e.time_s or 0.0, 6) + 0.0, e.frame_id, e.data, e.is_extended, e.received)
        for e in entries
        if e.unread is None
    ]
    accounted = sum(entry.number for entry in entries)
    there = COUNTERS[".mf4"](path.read_bytes())
    faults = [] if accounted in there else [f"{accounted} accounted for, {there} are there"]
    if is_cut and frames != list(seed.frames[: len(frames)]):
        faults.append("the frames of a log that is cut off are not its first ones")
    _note(findings, seed, path, "read", faults)


# --- All -----------------------------------------------------------------------------------------


def fuzz(
    count: int,
    seed: int,
    with_mdf4: bool = True,
    progress: Callable[[int], None] = lambda done: None,
) -> Findings:
    """Damage and read `count` logs; the share of MDF 4 is small, for it takes long."""
    rng = random.Random(seed)
    findings = Findings()
    with TemporaryDirectory() as name:
        folder = Path(name)
        intact = seeds(folder, with_mdf4)
        mdf4 = [one for one in intact if one.suffix == ".mf4"]
        by_suffix: dict[str, list[Seed]] = {}
        for one in intact:
            by_suffix.setdefault(one.suffix, []).append(one)
        suffixes = [suffix for suffix in by_suffix if suffix != ".mf4"]
        batch: list[tuple[Path, bool]] = []
        for number in range(count):
            if mdf4 and rng.random() < _MDF4_SHARE:
                content, is_cut = damaged(rng, mdf4[0], intact)
                path = folder / f"{len(batch)}.mf4"
                path.write_bytes(content)
                batch.append((path, is_cut))
                if len(batch) == _MDF4_BATCH:
                    check_mdf4(mdf4[0], batch, findings)
                    batch.clear()
                continue
            similar = by_suffix[suffixes[number % len(suffixes)]]
            one = rng.choice(similar)
            content, is_cut = damaged(rng, one, similar)
            path = folder / f"damaged{one.suffix}"
            path.write_bytes(content)
            check(one, path, is_cut, findings)
            progress(number)
        if batch:
            check_mdf4(mdf4[0], batch, findings)
    return findings


def main() -> None:
    """Run from the command line."""
    count, seed = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1
    started_s = time.monotonic()

    def progress(done: int) -> None:
        if done and done % 100_000 == 0:
            print(f"{done} logs, {time.monotonic() - started_s:.0f} s", file=sys.stderr)

    findings = fuzz(count, seed, progress=progress)
    for (suffix, outcome), number in sorted(findings.outcomes.items()):
        print(f"{suffix:8} {outcome:18} {number:8}")
    print(f"the slowest took {findings.slowest_s:.3f} s", file=sys.stderr)
    print(f"{count} logs, seed {seed}")
    for fault in findings.wrong[:20]:
        print(fault)
    print(f"{len(findings.wrong)} faults")
    sys.exit(1 if findings.wrong else 0)


if __name__ == "__main__":
    main()
