"""Worst stack of a function and all that it calls, from gcc's -fcallgraph-info=su."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bms.errors import InputError

_NODE = re.compile(r'^node: \{ title: "(?P<title>[^"]+)" label: "(?P<label>[^"]*)"')
_SOURCE = re.compile(r"\\n(?P<file>[^:\\]+\.[ch]):\d+:\d+")
_LINKED = re.compile(r'"[^"]*\.ltrans\d+\.o:(?=[^"]+")')
_EDGE = re.compile(r'^edge: \{ sourcename: "(?P<caller>[^"]+)" targetname: "(?P<callee>[^"]+)"')
_FRAME = re.compile(r"\\n(?P<bytes>\d+) bytes \((?P<kind>[^)]+)\)")
_INDIRECT = "__indirect_call"


def defined_functions(path: Path) -> dict[str, str]:
    """Name -> source file of each function that the compiler made code for, from a .ci file."""
    found = (_NODE.match(line) for line in lines_of(path))
    return {
        node["title"]: source["file"]
        for node in found
        if node and _FRAME.search(node["label"]) and (source := _SOURCE.search(node["label"]))
    }


def lines_of(path: Path) -> list[str]:
    """Lines of a .ci file. Functions that were optimised together at the link have their names in
    the assembler, without the temporary file that the compiler gives them."""
    return _LINKED.sub('"', path.read_text(encoding="utf-8")).splitlines()


@dataclass
class CallGraph:
    """Functions by name, static ones as `firmware_c/src/file.c:name`; frames in bytes."""

    frames: dict[str, int] = field(default_factory=dict)
    callees: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))

    def worst(self, function: str) -> int:
        """Bytes of stack from the call of a function on.

        Raises InputError for recursion and for a function of which no frame is known.
        """
        return self._worst(function, (), {})

    def _worst(self, function: str, chain: tuple[str, ...], known: dict[str, int]) -> int:
        if function in chain:
            path = " -> ".join((*chain[chain.index(function) :], function))
            raise InputError(f"stack: recursion {path}; a bound of the stack needs a loop instead")
        if function not in known:
            if function not in self.frames:
                raise InputError(f"stack: no frame known of {function}, called by {chain[-1:]}")
            deeper = (
                self._worst(callee, (*chain, function), known)
                for callee in self.callees.get(function, ())
            )
            known[function] = self.frames[function] + max(deeper, default=0)
        return known[function]


def read_call_graph(
    files: Iterable[Path],
    library_frames: Mapping[str, int],
    indirect: Mapping[str, Iterable[str]],
) -> CallGraph:
    """Call graph of a program from its .ci files.

    `library_frames` gives the stack of functions that were not compiled here, with all that they
    call; `indirect` names what a function may call through a pointer. Raises InputError for a
    pointer call that is not declared, for one declared that does not exist, and for a frame whose
    size is not fixed.
    """
    graph = CallGraph(frames=dict(library_frames))
    through_pointers = set()
    for line in (line for path in files for line in lines_of(path)):
        if (node := _NODE.match(line)) and (frame := _FRAME.search(node["label"])):
            if frame["kind"] != "static":
                raise InputError(f"stack: frame of {node['title']} has no fixed size")
            graph.frames[node["title"]] = int(frame["bytes"])
        elif edge := _EDGE.match(line):
            if edge["callee"] == _INDIRECT:
                through_pointers.add(edge["caller"])
            else:
                graph.callees[edge["caller"]].add(edge["callee"])
    if odd := through_pointers.symmetric_difference(indirect):
        raise InputError(
            f"stack: calls through pointers in {', '.join(sorted(odd))} and their declaration "
            "differ; name the callees under [indirect_calls] of firmware_c/budgets.toml"
        )
    for caller, callees in indirect.items():
        graph.callees[caller].update(_in_whole(callee, graph.frames) for callee in callees)
    return graph


def _in_whole(function: str, frames: Mapping[str, int]) -> str:
    """Name of a declared function: static ones of what was optimised as a whole have no file."""
    return function if function in frames else function.rpartition(":")[2]
