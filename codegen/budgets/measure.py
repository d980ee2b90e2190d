"""Figures of a built image: by module, of the core, of the whole."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable
from pathlib import Path

from codegen.budgets.budgets import Budget, Figures
from codegen.budgets.call_graph import CallGraph, read_call_graph
from codegen.budgets.library_stack import library_frames
from codegen.budgets.link_map import LIBRARY, Sizes, read_map

CORE_FUNCTIONS = ("bms_init", "bms_receive", "bms_step", "bms_transmit")
HANDLERS = ("systick_handler", "uart0_receive_handler", "uart0_send_handler")
START = "reset_handler"
CONTROL, CORE, BOOT, IMAGE = "control", "core", "boot", "image"
CONTROL_MODULES = (
    *(f"src/{name}" for name in ("calibration", "history", "kan", "rcbf", "soc", "thermal")),
    *(
        f"src/family_{name}"
        for name in ("decision", "observer", "plausibility", "tables", "windows")
    ),
    "generated/calibration_default",
)
"""What estimates and decides, with its tables; the rest of the core is CAN, monitor and states."""


def measure(build: Path, budget: Budget, cross: str) -> dict[str, Figures]:
    """Figures of the image in a build folder of a microcontroller port, row by row.

    Rows are the modules, the boot stage, control, the core and the image. The stack of a module is
    the worst from a call of any of its functions, the image's that of the main program when the
    deepest interrupt comes at the worst moment, the boot stage's that of its own, which has none.
    """
    application, boot = read_map(build / "firmware.map"), read_map(build / "boot.map")
    library = library_frames(build / "firmware.elf", cross)
    files = _linked_files(build / "application", application)
    graph = read_call_graph(files, library, budget.indirect_calls)
    boot_graph = read_call_graph(
        _linked_files(build / "boot", boot),
        library_frames(build / "boot.elf", cross),
        budget.indirect_calls,
    )
    # What the linker left out may call what it left out too.
    linked = {path: [f for f in _functions(path) if f.split(":")[-1] in library] for path in files}
    stacks = {
        _module(path): _stack(graph, functions) for path, functions in linked.items() if functions
    }
    rows = {
        module: Figures(
            application.flash[module], application.ram.get(module, 0), stacks.get(module)
        )
        for module in sorted(application.flash)
    }
    core_modules = [m for m in rows if m == LIBRARY or m.split("/")[0] in ("src", "generated")]
    rows[BOOT] = Figures(_total(boot, boot.flash), sum(boot.ram.values()), boot_graph.worst(START))
    rows[CONTROL] = Figures(flash=_total(application, CONTROL_MODULES))
    rows[CORE] = Figures(
        _total(application, core_modules),
        _size_of_state(build / "sizes.o", cross),
        _stack(graph, CORE_FUNCTIONS),
    )
    rows[IMAGE] = Figures(
        _total(application, application.flash) + _total(boot, boot.flash),
        sum(application.ram.values()),
        graph.worst(START) + budget.exception_frame + _stack(graph, HANDLERS),
    )
    return rows


def _linked_files(folder: Path, sizes: Sizes) -> list[Path]:
    return [path for path in sorted(folder.rglob("*.ci")) if _module(path) in sizes.flash]


def _total(sizes: Sizes, modules: Iterable[str]) -> int:
    return sum(sizes.flash[module] for module in modules)


def _stack(graph: CallGraph, functions: Iterable[str]) -> int:
    return max(map(graph.worst, functions), default=0)


def _functions(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8")
    return re.findall(r'title: "([^"]+)" label: "[^"]*bytes \(', text)


def _module(path: Path) -> str:
    return str(path.with_suffix("")).rpartition("firmware_c/")[2]


def _size_of_state(sizes: Path, cross: str) -> int:
    listing = subprocess.run(
        [f"{cross}nm", "-S", sizes], capture_output=True, text=True, check=True
    ).stdout
    return int(listing.split()[1], 16)
