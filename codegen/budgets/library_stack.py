"""Stack of the compiler's and the C library's functions, from their instructions."""

from __future__ import annotations

import re
import subprocess
from bisect import bisect_right
from itertools import pairwise
from pathlib import Path

_SYMBOL = re.compile(r"^(?P<address>[0-9a-f]+) [TtWw] (?P<name>\S+)$")
_INSTRUCTION = re.compile(r"^ *(?P<address>[0-9a-f]+):\t(?P<mnemonic>\S+)(?:\t(?P<operands>.*))?$")
_BRANCH_TARGET = re.compile(r"^([0-9a-f]+) <")
_WORD, _DOUBLE = 4, 8


def library_frames(elf: Path, cross: str) -> dict[str, int]:
    """Function -> bytes that it and all that it calls push, an upper bound.

    Every push of a function counts, whichever way it takes. Meant for leaf-like assembler routines;
    of C functions the compiler itself knows better.
    """
    symbols = _symbols(elf, cross)
    starts = sorted(set(symbols.values()))
    nexts = dict(pairwise(starts))
    bodies: dict[int, list[tuple[str, str]]] = {start: [] for start in starts}

    def function_at(address: int) -> int:
        return starts[max(bisect_right(starts, address) - 1, 0)]

    for address, instruction in _instructions(elf, cross).items():
        bodies[function_at(address)].append(instruction)

    def worst(start: int, chain: frozenset[int]) -> int:
        body = bodies.get(start, [])
        if start in chain or not body:
            return 0
        targets = [_BRANCH_TARGET.match(operands) for name, operands in body if name[0] == "b"]
        onward = {function_at(int(target[1], 16)) for target in targets if target} - {start}
        if start in nexts and not _ends(*body[-1]):
            onward.add(nexts[start])  # runs into the next one
        deeper = (worst(callee, chain | {start}) for callee in onward)
        return sum(_pushed(*instruction) for instruction in body) + max(deeper, default=0)

    return {name: worst(start, frozenset()) for name, start in symbols.items()}


def _symbols(elf: Path, cross: str) -> dict[str, int]:
    found = (_SYMBOL.match(line) for line in _output(f"{cross}nm", elf))
    return {m["name"]: int(m["address"], 16) & ~1 for m in found if m}


def _instructions(elf: Path, cross: str) -> dict[int, tuple[str, str]]:
    lines = _output(f"{cross}objdump", "-d", "--no-show-raw-insn", elf)
    found = (_INSTRUCTION.match(line) for line in lines)
    return {int(m["address"], 16): (m["mnemonic"], m["operands"] or "") for m in found if m}


def _ends(mnemonic: str, operands: str) -> bool:
    """Whether a function may end with this instruction; data behind it counts as one."""
    return _base(mnemonic) in ("b", "bx", "") or "pc" in operands


def _pushed(mnemonic: str, operands: str) -> int:
    base = _base(mnemonic)
    if base == "push" or (base in ("stmdb", "stmfd") and operands.startswith("sp!")):
        return _WORD * _registers(operands)
    if base == "vpush":
        return (_DOUBLE if "d" in operands else _WORD) * _registers(operands)
    if base == "sub" and (found := re.match(r"sp, (?:sp, )?#(\d+)", operands)):
        return int(found[1])
    if base == "str" and (found := re.search(r"\[sp, #-(\d+)\]!", operands)):
        return int(found[1])
    return 0


def _base(mnemonic: str) -> str:
    """Without the width that was chosen, as in `b.n`; nothing is left of `.word`."""
    return mnemonic.partition(".")[0]


def _registers(operands: str) -> int:
    count = 0
    for item in operands[operands.index("{") + 1 : operands.index("}")].split(","):
        first, _, last = item.strip().partition("-")
        count += int(last[1:]) - int(first[1:]) + 1 if last else 1
    return count


def _output(*command: str | Path) -> list[str]:
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()
