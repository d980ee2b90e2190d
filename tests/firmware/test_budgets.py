"""Budgets: figures are what the tools of the compiler say, and a figure beyond its limit fails."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bms.errors import InputError
from codegen.budgets.budgets import Figures, exceeded, load_budget, load_figures, table
from codegen.budgets.call_graph import CallGraph, read_call_graph
from codegen.budgets.library_stack import library_frames
from codegen.budgets.link_map import read_map
from codegen.budgets.measure import measure, owners_of_whole
from hil_sim.bus.buses import Frame, open_bus
from hil_sim.targets import Emulation
from tests.firmware.bench import HEALTHY, MEASURED, frame
from tests.firmware.monitor import monitor, monitor_options
from tests.firmware.ports import BOARDS, CROSS, ROOT, build, built, needs_compiler, needs_emulator

FIRMWARE = ROOT / "firmware_c"
FILES = ("budgets.toml", "figures.json")
RAM_START, STACK_BYTES = 0x2000_0000, 2048
LIMITS = [
    *("control_flash", "core_flash", "core_ram", "core_stack", "boot_flash", "boot_stack"),
    *("image_flash", "image_ram", "stack"),
]
PROCESSOR = ["-mcpu=cortex-m3", "-mthumb"]


def output(*command: object) -> str:
    return subprocess.run([*map(str, command)], check=True, capture_output=True, text=True).stdout


def figures(target: str) -> dict[str, Figures]:
    return measure(built(target), load_budget(FIRMWARE / "budgets.toml", target), CROSS)


def run_budgets(target: str, folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "codegen.budgets", built(target), "--target", target]
    command += ["--firmware", folder, *options]
    return subprocess.run(
        [*map(str, command)], cwd=ROOT, capture_output=True, text=True, check=False
    )


def call_graph_of(source: str, folder: Path, **indirect: list[str]) -> CallGraph:
    folder.mkdir(exist_ok=True)
    (folder / "part.c").write_text(source)
    flags = [*PROCESSOR, "-O0", "-fcallgraph-info=su", "-c"]
    subprocess.run([f"{CROSS}gcc", *flags, "part.c", "-o", "part.o"], cwd=folder, check=True)
    return read_call_graph([folder / "part.ci"], {}, indirect)


@needs_compiler
@pytest.mark.parametrize("target", BOARDS)
def test_modules_add_up_to_the_linked_sections(target: str) -> None:
    sizes = {}
    for line in output(f"{CROSS}size", "-A", built(target) / "firmware.elf").splitlines():
        if found := re.match(r"\.(\w+)\s+(\d+)", line):
            sizes[found[1]] = int(found[2])
    found_sizes = read_map(built(target) / "firmware.map")
    parts = ("application_header", "application", "calibration_header", "calibration")
    alignment = sum(sizes[part] for part in parts) - sum(found_sizes.flash.values())
    assert 0 <= alignment < 64
    assert sum(found_sizes.ram.values()) == sizes["bss"]


@needs_compiler
@pytest.mark.parametrize("module", ["src/codec", "port/slcan"])
def test_a_module_is_as_large_as_its_symbols(module: str) -> None:
    """One that the link optimises with the others, and one of the port, as they are written."""
    folder = built("mps2_an386")
    source = (FIRMWARE / f"{module}.c").read_text()
    names = {
        *re.findall(r"^[A-Za-z][\w *]*?(\w+)\(", source, re.M),
        *re.findall(r"\bconst (?:\w+ )?(\w+)\[", source),
    }
    total = 0
    for line in output(f"{CROSS}nm", "-S", folder / "firmware.elf").splitlines():
        if len(fields := line.split()) == 4 and fields[3].partition(".")[0] in names:
            total += int(fields[1], 16)
    assert total > 300
    sizes = read_map(folder / "firmware.map", owners_of_whole(folder, CROSS))
    assert sizes.flash[module] == pytest.approx(total, abs=16)


@needs_compiler
def test_the_whole_image_is_what_stands_in_flash() -> None:
    rows = figures("mps2_an386")
    written = len((built("mps2_an386") / "firmware.bin").read_bytes().replace(b"\xff", b""))
    assert 0.9 * written < rows["image"].flash < 1.1 * written
    assert rows["control"].flash < rows["core"].flash
    assert rows["core"].flash + rows["boot"].flash < rows["image"].flash


@needs_compiler
def test_stack_adds_up_along_the_deepest_chain(tmp_path: Path) -> None:
    graph = call_graph_of(
        "void use(char *);\n"
        "void use(char *bytes) { bytes[0] = 1; }\n"
        "void small(void); void small(void) { char b[16]; use(b); }\n"
        "void large(void); void large(void) { char b[96]; use(b); small(); }\n"
        "void top(void); void top(void) { small(); large(); small(); }\n",
        tmp_path,
    )
    assert graph.frames["large"] >= 96 and graph.frames["small"] >= 16
    deepest = [graph.frames[name] for name in ("top", "large", "small", "use")]
    assert graph.worst("top") == sum(deepest)


@needs_compiler
@pytest.mark.parametrize(
    ("source", "words"),
    [
        (
            "int f(int n); int f(int n) { return n ? n * f(n - 1) * f(n / 2) : 1; }",
            "recursion f -> f",
        ),
        (
            "int g(int); int f(int n); int f(int n) { return n ? g(n - 1) + 1 : 1; }\n"
            "int g(int n) { return f(n) + 2; }",
            "recursion",
        ),
        ("int f(int (*p)(void)); int f(int (*p)(void)) { return p() + 1; }", "pointers in f"),
        ("void g(char *); void f(int n); void f(int n) { char b[n]; g(b); }", "no fixed size"),
        ("int g(void); int f(void); int f(void) { return g() + 1; }", "no frame known of g"),
    ],
    ids=["itself", "each other", "pointer", "dynamic", "unknown"],
)
def test_stack_without_a_bound_is_an_error(source: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        call_graph_of(source, tmp_path).worst("f")


@needs_compiler
def test_a_declared_call_through_a_pointer_counts(tmp_path: Path) -> None:
    source = (
        "void use(char *); void use(char *b) { b[0] = 1; }\n"
        "void deep(void); void deep(void) { char b[200]; use(b); }\n"
        "void f(void (*p)(void)); void f(void (*p)(void)) { p(); p(); }\n"
    )
    graph = call_graph_of(source, tmp_path, f=["deep"])
    assert graph.worst("f") == sum(graph.frames[name] for name in ("f", "deep", "use"))
    with pytest.raises(InputError, match="pointers in nobody"):
        call_graph_of(source, tmp_path, f=["deep"], nobody=["deep"])


@needs_compiler
def test_frames_of_the_library_are_read_from_its_instructions(tmp_path: Path) -> None:
    (tmp_path / "part.s").write_text(
        ".syntax unified\n.thumb\n.text\n"
        ".type leaf, %function\nleaf: push {r4, r5, r6, lr}\n sub sp, #24\n b .\n"
        ".type middle, %function\nmiddle: str lr, [sp, #-8]!\n bl leaf\n ldr pc, [sp], #8\n"
        ".type falls, %function\nfalls: stmdb sp!, {r4-r7}\n movs r0, r0\n"
        ".type into, %function\ninto: vpush {d8-d9}\n bx lr\n"
        ".type inside, %function\ninside: push {r4, lr}\n cbz r0, 1f\n b leaf + 4\n"
        "1: pop {r4, pc}\n"
    )
    output(
        f"{CROSS}as",
        "-mcpu=cortex-m4",
        "-mfpu=fpv4-sp-d16",
        tmp_path / "part.s",
        "-o",
        tmp_path / "part.o",
    )
    output(
        f"{CROSS}ld",
        "-Ttext=0x1000",
        "-e",
        "middle",
        tmp_path / "part.o",
        "-o",
        tmp_path / "part.elf",
    )
    frames = library_frames(tmp_path / "part.elf", CROSS)
    assert (frames["leaf"], frames["middle"]) == (40, 48)
    assert (frames["falls"], frames["into"]) == (32, 16)
    assert frames["inside"] == 8 + frames["leaf"], "a branch into the middle counts as a call"


@needs_compiler
@pytest.mark.parametrize("limit", LIMITS)
def test_each_limit_fails_when_it_is_exceeded(limit: str, tmp_path: Path) -> None:
    for name in FILES:
        shutil.copy(FIRMWARE / name, tmp_path)
    text = (tmp_path / "budgets.toml").read_text()
    rows = figures("mps2_an386")
    row, _, figure = limit.rpartition("_")
    used = getattr(rows[row or "image"], figure)
    lowered = re.sub(rf"^{limit} = \d+$", f"{limit} = {used - 1}", text, flags=re.M)
    (tmp_path / "budgets.toml").write_text(lowered)
    done = run_budgets("mps2_an386", tmp_path)
    assert done.returncode == 1
    assert (
        done.stderr
        == f"budgets: mps2_an386 {limit}: {used} bytes, 1 more than the {used - 1} allowed\n"
    )


@pytest.mark.parametrize("target", BOARDS)
def test_every_board_has_all_limits(target: str) -> None:
    assert list(load_budget(FIRMWARE / "budgets.toml", target).limits) == LIMITS


@needs_compiler
def test_the_boot_stage_needs_the_stack_of_its_own_deepest_chain() -> None:
    """At least main, the frames it refuses with, and their text; no state outside the stack."""
    rows = figures("mps2_an386")
    assert 3 * 16 < rows["boot"].stack < rows["image"].stack
    assert rows["boot"].ram == 0


@needs_compiler
def test_the_build_fails_with_the_budget(tmp_path: Path) -> None:
    built("mps2_an386")
    for folder in ("firmware_c", "build/firmware/mps2_an386"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    path = tmp_path / "firmware_c" / "budgets.toml"
    path.write_text(re.sub(r"core_ram = \d+", "core_ram = 1", path.read_text()))
    with pytest.raises(subprocess.CalledProcessError) as failed:
        build("mps2_an386", tmp_path)
    assert "core_ram" in failed.value.stderr


@needs_compiler
def test_accepted_figures_are_what_the_next_table_compares_with(tmp_path: Path) -> None:
    shutil.copy(FIRMWARE / "budgets.toml", tmp_path)
    assert " new" in run_budgets("mps2_an386", tmp_path, "--accept").stdout
    assert not re.search(
        r"new|[+-]\d", run_budgets("mps2_an386", tmp_path).stdout.partition("\n")[2]
    )
    accepted = json.loads((tmp_path / "figures.json").read_text())
    accepted["mps2_an386"]["core"]["flash"] -= 100
    (tmp_path / "figures.json").write_text(json.dumps(accepted))
    assert re.search(r"^core .*\+100", run_budgets("mps2_an386", tmp_path).stdout, re.M)


def test_a_table_says_what_changed() -> None:
    now = {"core": Figures(1000, 50, 80), "boot": Figures(flash=30)}
    lines = table(now, {"core": Figures(900, 50, 90)}).splitlines()
    assert lines[1].split() == ["core", "1000", "+100", "50", "80", "-10"]
    assert lines[2].split() == ["boot", "30", "new"]
    assert exceeded(now, {"core_flash": 1000, "core_stack": 79}) == [
        "core_stack: 80 bytes, 1 more than the 79 allowed"
    ]


def test_a_port_without_a_budget_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"budgets\.toml: no 'nothing'"):
        load_budget(FIRMWARE / "budgets.toml", "nothing")


@pytest.mark.parametrize("target", BOARDS)
def test_figures_of_every_board_are_accepted(target: str) -> None:
    assert {"core", "boot", "image"} <= set(load_figures(FIRMWARE / "figures.json", target))


@needs_emulator
@pytest.mark.parametrize("target", BOARDS)
def test_the_stack_that_the_beginning_of_a_charge_uses_is_within_the_bound(
    target: str, tmp_path: Path
) -> None:
    """RAM is zero when the board starts; what is no longer zero has been used."""
    socket_path, dump = tmp_path / "monitor", tmp_path / "stack.bin"
    options = monitor_options(socket_path)
    image = built(target) / "firmware.bin"
    with Emulation(image, BOARDS[target], options=options) as board, open_bus(board.bus) as bus:
        for period in range(60):
            values = HEALTHY | {"Request": float(period > 10)}
            for name in MEASURED:
                bus.send(Frame(*frame(name, period, values)))
            bus.send(Frame(0x080, b""))
            while (heard := bus.receive(10.0)) is not None and heard.frame_id != 0x180:
                pass
        with monitor(socket_path) as observer:
            observer.execute("pmemsave", val=RAM_START, size=STACK_BYTES, filename=str(dump))
    content = dump.read_bytes()
    used = len(content.lstrip(b"\0"))
    assert len(content) == STACK_BYTES
    assert 0.5 * figures(target)["image"].stack < used <= figures(target)["image"].stack
