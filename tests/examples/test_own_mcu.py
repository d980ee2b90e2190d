"""examples/own_mcu: fails closed, and prints the same on the host and on an emulated Cortex-M4F."""

from __future__ import annotations

import math
import re
import shutil
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from cffi import FFI

from bms.barrier.margins import sampling_margins
from bms.barrier.readings import soc_error_bound
from bms.native_build import CORE_HEADERS, ROOT
from bms.presets import load_preset
from tests.codegen.cmake import needs_cmake
from tests.examples.shell import run
from tests.firmware.native_library import load_library
from tests.firmware.ports import needs_emulator

EXAMPLE = ROOT / "examples" / "own_mcu"
CORE = ROOT / "firmware_c"
PAGE = ROOT / "docs" / "core-without-frames.md"
STATES = 6
PRESET = load_preset("paper_calibrated")
GROWTH_A = -PRESET.limits.current_growth_A_per_s * PRESET.timing.sampling_period_s
STRONGEST_A = PRESET.limits.reference_current_A
LINE = re.compile(
    r"(?P<name>[\w ]+): core (?P<core_K>\S+) K, soc (?P<soc>\S+), (?P<current_A>\S+) A, "
    r"active (?P<active>\d), first fault (?P<fault>\d+)"
)
RIGHT_CHOICE = "(wanted_A < allowed_A) ? allowed_A : wanted_A"
WRONG_CHOICE = "(wanted_A > allowed_A) ? wanted_A : allowed_A"
UNLIKE_THE_TRAINING = {"surface_temperature_K": 316.0, "coolant_temperature_K": 274.0}
NO_FAULT, SURFACE_RANGE, OUT_OF_DOMAIN, OVER_VOLTAGE = 255, 6, 10, 13
NONE, VOLTAGE, CORE_LIMIT, INVALID = 0, 1, 3, 6


def load_control(out: Path, change: tuple[str, str] | None = None) -> tuple[FFI, Any]:
    """The example's control.c with the core; `change` replaces a text in it by another one."""
    out.mkdir(exist_ok=True)
    shutil.copy(EXAMPLE / "control.h", out)
    modules = (
        *("calibration", "family_tables", "history", "kan", "monitor"),
        *("planner", "rcbf", "soc", "thermal"),
    )
    sources = [EXAMPLE / "control.c", CORE / "generated" / "calibration_default.c"]
    sources += [CORE / "src" / f"{module}.c" for module in modules]
    headers = [header.removeprefix("firmware_c/") for header in CORE_HEADERS]
    return load_library(
        out,
        sources,
        [*headers, "../examples/own_mcu/control.h"],
        None if change is None else ("control.c", *change),
        "extern bms_calibration_t BMS_DEFAULT_CALIBRATION;",
    )


class Control:
    """A charge under the example's control."""

    def __init__(self, ffi: FFI, lib: Any) -> None:
        self._lib = lib
        self._calibration = ffi.addressof(lib, "BMS_DEFAULT_CALIBRATION")
        self.state: Any = ffi.new("control_t *")
        self._readings = ffi.new("control_readings_t *")
        assert self.begin(0.4)

    def begin(self, soc: float) -> bool:
        return bool(self._lib.control_begin(self.state, self._calibration, soc))

    def step(self, wanted_A: float = STRONGEST_A, **readings: float) -> float:
        """One period at rest near 300 K, but for the readings that are given."""
        content = {
            "current_A": self.state.command_A,
            "voltage_V": 3.4,
            "cooling_power_W": 0.23,
            "surface_temperature_K": 300.0,
            "coolant_temperature_K": 298.0,
            **readings,
        }
        for name, value in content.items():
            setattr(self._readings, name, value)
        return float(self._lib.control_step(self.state, self._readings, wanted_A))


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> tuple[FFI, Any]:
    return load_control(tmp_path_factory.mktemp("control"))


@pytest.fixture
def control(library: tuple[FFI, Any]) -> Control:
    return Control(*library)


def test_the_current_grows_by_no_more_than_the_limit_and_ends_at_the_strongest(
    control: Control,
) -> None:
    currents_A = [0.0, *(control.step() for _ in range(120))]
    steps_A = [after - before for before, after in pairwise(currents_A)]
    assert min(steps_A) == pytest.approx(GROWTH_A, abs=1e-5)
    assert min(currents_A) == currents_A[-1] == STRONGEST_A


def test_a_weaker_wish_is_met(control: Control) -> None:
    assert [control.step(wanted_A=-0.1) for _ in range(3)] == pytest.approx([-0.1] * 3)


@pytest.mark.parametrize("wanted_A", [math.nan, math.inf, 1.0])
def test_a_wish_that_is_no_charging_current_gives_none(control: Control, wanted_A: float) -> None:
    assert control.step() < 0.0
    assert control.step(wanted_A=wanted_A) == 0.0


@pytest.mark.parametrize(
    "name",
    [
        *("current_A", "voltage_V", "cooling_power_W"),
        *("surface_temperature_K", "coolant_temperature_K"),
    ],
)
def test_a_reading_that_is_none_stops_at_once_and_for_good_when_it_lasts(
    control: Control, name: str
) -> None:
    assert control.step() < 0.0
    assert control.step(**{name: math.nan}) == 0.0
    assert control.step() < 0.0, "a single one is forgiven"
    assert [control.step(**{name: math.nan}) for _ in range(3)] == [0.0] * 3
    assert [control.step() for _ in range(3)] == [0.0] * 3
    assert control.begin(0.4)
    assert control.step() < 0.0


def test_readings_unlike_the_training_stop_at_once(control: Control) -> None:
    assert control.step() < 0.0
    assert control.step(**UNLIKE_THE_TRAINING) == 0.0
    assert control.state.monitor.active == 1 << OUT_OF_DOMAIN


def test_over_voltage_stops_at_once(control: Control) -> None:
    assert control.step() < 0.0
    assert control.step(voltage_V=3.66) == 0.0
    assert control.state.monitor.active == 1 << OVER_VOLTAGE


def test_a_charge_begins_only_at_a_state_of_charge_that_can_be(control: Control) -> None:
    assert [control.begin(soc) for soc in (0.0, 1.0)] == [True, True]
    assert [control.begin(soc) for soc in (-0.01, 1.01, math.nan)] == [False, False, False]


def test_a_full_cell_gets_nothing(control: Control) -> None:
    assert control.begin(0.9899)
    assert control.step() < 0.0
    assert control.begin(0.9901)
    assert control.step() == 0.0


@pytest.mark.parametrize(
    ("right", "wrong", "period"),
    [
        ("!control->monitor.stop &&", "", UNLIKE_THE_TRAINING),
        (RIGHT_CHOICE, WRONG_CHOICE, {"wanted_A": math.nan}),
        ("is_outside(now->voltage_V", "is_outside(3.4f", {"voltage_V": math.nan}),
    ],
    ids=["no monitor", "a comparison that lets NaN pass", "a reading that nobody checks"],
)  # fmt: skip
def test_broken_on_purpose_the_same_period_brings_a_current(
    tmp_path: Path, control: Control, right: str, wrong: str, period: dict[str, float]
) -> None:
    broken = Control(*load_control(tmp_path, (right, wrong)))
    for each in (control, broken):
        assert each.step() < 0.0
    assert control.step(**period) == 0.0
    assert broken.step(**period) < 0.0


def text_blocks(language: str) -> list[str]:
    page = PAGE.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("name", ["control.h", "control.c", "main.c"])
def test_the_page_shows_the_code_of_the_example(name: str) -> None:
    assert (EXAMPLE / name).read_text(encoding="utf-8") in text_blocks("c")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A place to run the page's commands in, where the examples are."""
    place = tmp_path_factory.mktemp("own mcu")
    (place / "examples").symlink_to(ROOT / "examples")
    return place


@pytest.fixture(scope="module")
def on_host(folder: Path) -> list[str]:
    """What the page's commands for the host print in the end."""
    host, _ = text_blocks("sh")
    done = run(["sh", "-eu", "-c", host], folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in done.stderr
    return done.stdout.splitlines()[-STATES:]


@pytest.mark.slow
@needs_cmake
def test_the_commands_of_the_page_print_what_it_shows(on_host: list[str]) -> None:
    (shown,) = text_blocks("text")
    assert shown.splitlines() == on_host


@pytest.mark.slow
@needs_cmake
def test_each_state_gets_the_decision_that_it_calls_for(on_host: list[str]) -> None:
    rows = {match["name"]: match for match in map(LINE.fullmatch, on_host) if match}
    reasons = {name: (int(row["active"]), int(row["fault"])) for name, row in rows.items()}
    assert reasons == {
        "cold and empty": (NONE, NO_FAULT),
        "warm": (NONE, NO_FAULT),
        "core near its limit": (CORE_LIMIT, NO_FAULT),
        "nearly full": (VOLTAGE, NO_FAULT),
        "unlike the training": (NONE, OUT_OF_DOMAIN),
        "broken sensor": (INVALID, SURFACE_RANGE),
    }
    current_A = {name: float(row["current_A"]) for name, row in rows.items()}
    assert current_A["cold and empty"] == pytest.approx(20.0 * GROWTH_A, rel=1e-6)
    assert current_A["warm"] == STRONGEST_A
    assert STRONGEST_A < current_A["core near its limit"] < -15.0
    soc = float(rows["nearly full"]["soc"]) + soc_error_bound(PRESET.cell, PRESET)
    left_V = (
        PRESET.limits.max_voltage_V
        - sampling_margins(PRESET.cell, PRESET).voltage_V
        - float(PRESET.cell.ocv(soc))
    )
    strongest_A = left_V / PRESET.cell.ohmic_resistance_ohm
    assert current_A["nearly full"] == pytest.approx(-strongest_A, abs=1e-3)
    assert current_A["unlike the training"] == current_A["broken sensor"] == 0.0
    soc = float(rows["warm"]["soc"])
    assert 0.40 + 2.0 * 20.0 / 8280.0 < soc < 0.40 + 2.0 * 23.0 / 8280.0


@pytest.mark.slow
@needs_cmake
@needs_emulator
def test_a_cortex_m4f_prints_the_same_to_the_last_bit(folder: Path, on_host: list[str]) -> None:
    _, board = text_blocks("sh")
    done = run(["sh", "-eu", "-c", board], folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in done.stderr
    assert done.stdout.splitlines()[-STATES:] == on_host
