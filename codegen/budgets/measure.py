"""Figures of a built image: by module, of the core, of the whole."""

from __future__ import annotations

import subprocess
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from codegen.budgets.budgets import Budget, Figures
from codegen.budgets.call_graph import CallGraph, defined_functions, read_call_graph
from codegen.budgets.library_stack import library_frames
from codegen.budgets.link_map import LIBRARY, Sizes, read_map

CORE_FUNCTIONS = ("bms_init", "bms_receive", "bms_step", "bms_transmit")
WHOLE = "unsealed.elf.ltrans*.ci"
"""What the compiler says of the modules that it optimised as a whole at the link."""
HANDLERS = ("systick_handler", "uart0_receive_handler", "uart0_send_handler")
START = "reset_handler"
CORE_FOLDERS = ("src", "generated")
CONTROL, CORE, BOOT, IMAGE = "control", "core", "boot", "image"
CONTROL_MODULES = (
    *(f"src/{name}" for name in ("calibration", "history", "kan", "rcbf", "soc", "thermal")),
    *(
        f"src/family_{name}"
        for name in ("decision", "observer", "plausibility", "tables", "windows")
    ),
    "generated/calibration_default",
)
"""What estimates and decides, with its tables; the rest of the core is CAN, monitor and states,
with what the compiler took into their functions."""


def measure(build: Path, budget: Budget, cross: str) -> dict[str, Figures]:
    """Figures of the image in a build folder of a microcontroller port, row by row.

    Rows are the modules, the boot stage, control, the core and the image. The stack of a module is
    the worst from a call of any of its functions, the image's that of the main program when the
    deepest interrupt comes at the worst moment, the boot stage's that of its own, which has none.
    """
    owners = owners_of_whole(build, cross)
    application, boot = read_map(build / "firmware.map", owners), read_map(build / "boot.map")
    library = library_frames(build / "firmware.elf", cross)
    whole = set(build.glob(WHOLE))
    optimised = set(owners.values())
    apart = _linked_files(build / "application", application)
    files = [*(path for path in apart if _module(path) not in optimised), *sorted(whole)]
    graph = read_call_graph(files, library, budget.indirect_calls)
    boot_graph = read_call_graph(
        _linked_files(build / "boot", boot),
        library_frames(build / "boot.elf", cross),
        {},
    )
    # What the linker left out may call what it left out too.
    linked: dict[str, list[str]] = defaultdict(list)
    for path in files:
        for function, source in defined_functions(path).items():
            if function.split(":")[-1] in library:
                linked[_module(Path(source) if path in whole else path)].append(function)
    stacks = {module: _stack(graph, functions) for module, functions in linked.items()}
    rows = {
        module: Figures(
            application.flash[module], application.ram.get(module, 0), stacks.get(module)
        )
        for module in sorted(application.flash)
    }
    core_modules = [m for m in rows if m == LIBRARY or m.split("/")[0] in CORE_FOLDERS]
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


def owners_of_whole(build: Path, cross: str) -> dict[str, str]:
    """Function or table -> module, of the modules that were optimised as a whole at the link. A
    name that tables of several modules have is left out."""
    owners = {
        function: _module(Path(source))
        for path in build.glob(WHOLE)
        for function, source in defined_functions(path).items()
    }
    tables: dict[str, set[str]] = defaultdict(set)
    objects = (build / "application").rglob("*.o") if owners else ()
    for path in objects:
        if _module(path).split("/")[0] in CORE_FOLDERS:
            for table in _tables(path, cross):
                tables[table.partition(".")[0]].add(_module(path))
    return {name: min(of) for name, of in tables.items() if len(of) == 1} | owners


def _linked_files(folder: Path, sizes: Sizes) -> list[Path]:
    return [path for path in sorted(folder.rglob("*.ci")) if _module(path) in sizes.flash]


def _total(sizes: Sizes, modules: Iterable[str]) -> int:
    return sum(sizes.flash[module] for module in modules)


def _stack(graph: CallGraph, functions: Iterable[str]) -> int:
    return max(map(graph.worst, functions), default=0)


def _tables(path: Path, cross: str) -> list[str]:
    # nm would list what the link is to optimise, without what a module keeps to itself.
    listing = subprocess.run(
        [f"{cross}readelf", "-sW", path], capture_output=True, text=True, check=True
    ).stdout
    return [fields[7] for line in listing.splitlines() if "OBJECT" in (fields := line.split())]


def _module(path: Path) -> str:
    return str(path.with_suffix("")).rpartition("firmware_c/")[2]


def _size_of_state(sizes: Path, cross: str) -> int:
    listing = subprocess.run(
        [f"{cross}nm", "-S", sizes], capture_output=True, text=True, check=True
    ).stdout
    return int(listing.split()[1], 16)
