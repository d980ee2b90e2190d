"""A smooth command: small steps where a limit is ridden, and never more than is admitted."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bms.firmware._firmware import ffi, lib
from bms.firmware.calibration import calibration_block
from bms.firmware.controller import write_decision_input
from bms.firmware.family_core import FamilyCore, family_reading
from bms.model import load_shipped_model
from bms.presets import load_preset
from hil_sim.bus.catalog import Mode
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings
from tests.firmware.bench import HEALTHY, Bench
from tests.firmware.edited_ecu import EditedEcu

LARGEST_RMS_A, LARGEST_STEP_A = 0.03, 0.15
PERIODS = 60


def block(name: str) -> Any:
    """Calibration block of a shipped preset (bms_calibration_t)."""
    preset = load_preset(name)
    return calibration_block(preset, load_shipped_model(name), compiled_in=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("preset", "start_K", "soc", "mode", "time_s"),
    [
        ("paper_calibrated", 313.0, 0.6, Mode.FASTEST, 700.0),
        ("paper_calibrated", 298.0, 0.6, None, 300.0),
        ("lin2014", 313.0, 0.3, None, 290.0),
        ("a123_26650_10C", 313.0, 0.5, Mode.FIXED, 200.0),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_steps_of_a_ridden_limit_are_small_with_noise_on(
    preset: str, start_K: float, soc: float, mode: Mode | None, time_s: float, seed: int
) -> None:
    loaded = load_preset(preset)
    initial = replace(loaded.initial, temperature_K=start_K, soc=soc)
    # A step of the ramp at the start is 0.5 A with the presets' own growth.
    growth_A = {"current_growth_A": LARGEST_STEP_A}
    result = run_both(
        Settings(loaded, initial=initial, mode=mode, seed=seed, max_time_s=time_s),
        ecu_factory=lambda plant, database: EditedEcu(preset, growth_A),
    )
    series = result.series
    command_A = np.array([math.nan if c is None else c for c in series.command_A])
    steps_A = np.diff(command_A)
    in_charge = np.array([state in ("charging", "derated") for state in series.state])
    derated = np.array([state == "derated" for state in series.state])
    assert result.summary.limits_kept
    assert derated.sum() > 300
    assert np.sqrt(np.mean(steps_A[derated[1:]] ** 2)) <= LARGEST_RMS_A
    # The bus has steps of 2 mA.
    assert np.abs(steps_A[in_charge[1:]]).max() <= LARGEST_STEP_A + 0.002


def inputs(states: list[tuple[float, ...]]) -> list[Any]:
    """Decision inputs from (soc, core, surface, coolant) in K above 300 and a reference in A."""
    made = []
    for core_K, surface_K, coolant_K, reference_A in states:
        into = ffi.new("rcbf_input_t *")
        write_decision_input(
            into,
            soc=0.5,
            core_temperature_K=core_K,
            surface_temperature_K=surface_K,
            coolant_temperature_K=coolant_K,
            cooling_power_W=0.5,
            reference_current_A=reference_A,
        )
        made.append(into)
    return made


NOISE_K = 0.05


def steadily(constants: Any, made: Any, steadier: Any) -> Any:
    """The decision with a memory, for the open-circuit voltage of the input's state of charge."""
    return lib.rcbf_solve_steadily(
        constants, made, lib.rcbf_open_circuit_voltage_V(constants, made.soc), steadier
    )


STATES = st.lists(
    st.tuples(
        st.floats(315.0, 323.2),
        st.floats(308.0, 322.5),
        st.floats(300.0, 315.0),
        st.lists(st.floats(-NOISE_K, NOISE_K), min_size=2, max_size=10),
    ),
    min_size=1,
    max_size=4,
).map(
    lambda parts: [
        (core_K, surface_K + noise_K, coolant_K, -23.0)
        for core_K, surface_K, coolant_K, noises_K in parts
        for noise_K in noises_K
    ]
)
"""Readings that jitter, and now and then jump."""


@pytest.mark.parametrize("preset", ["paper_calibrated", "lin2014"])
@settings(max_examples=100, deadline=None)
@given(states=STATES)
def test_a_steadied_decision_is_no_stronger_than_that_of_the_same_readings(
    preset: str, states: list[tuple[float, ...]]
) -> None:
    constants = ffi.addressof(BLOCKS[preset].rcbf)
    steadier = ffi.new("rcbf_steadier_t *")
    lib.rcbf_steadier_reset(steadier)
    for number, made in enumerate(inputs(states)):
        plain = lib.rcbf_solve(constants, made)
        steadied = steadily(constants, made, steadier)
        if number == 0:
            assert steadied.current_A == plain.current_A
        assert steadied.current_A >= plain.current_A - 1e-4
        assert plain.feasible or not steadied.feasible


BLOCKS = {name: block(name) for name in ("paper_calibrated", "lin2014")}


def test_a_steadied_decision_recovers_from_what_is_no_number() -> None:
    constants = ffi.addressof(BLOCKS["lin2014"].rcbf)
    (made,) = inputs([(310.0, 309.0, 308.0, -23.0)])
    steadier = ffi.new(
        "rcbf_steadier_t *", {"core_K_per_s": math.nan, "surface_K_per_s2": math.nan}
    )
    steadied = steadily(constants, made, steadier)
    assert steadied.feasible
    assert steadied.current_A == lib.rcbf_solve(constants, made).current_A


def test_a_family_believes_no_less_voltage_than_was_read() -> None:
    random = np.random.default_rng(4)
    core = FamilyCore(block("a123_26650_10C"))
    for _ in range(PERIODS):
        reading = family_reading(
            current_A=random.uniform(-23.0, 0.0),
            voltage_V=random.uniform(3.2, 3.6),
            surface_temperature_K=310.0,
            coolant_temperature_K=308.0,
            estimated_core_K=312.0,
            command_A=-10.0,
            is_usable=True,
            is_charging=True,
        )
        core.observe(reading)
        steadied_A = core.decide(reading, -23.0)
        assert core.state.steadied_V >= 0.0
        core.state.steadied_V = 0.0
        assert steadied_A >= core.decide(reading, -23.0)


def test_a_charge_begins_with_the_presets_growth_and_follows_later_requests_gently() -> None:
    bench = Bench(values={**HEALTHY, "Mode": int(Mode.FIXED)})
    growth_A = bench.ecu.preset.limits.current_growth_A_per_s * 0.1
    bench.get_ready(ReferenceCurrent=-5.0)
    rises_A = []
    for reference_A, periods in ((-5.0, 30), (-15.0, 90)):
        for _ in range(periods):
            before_A = bench.command_A
            bench.period(Request=1, ReferenceCurrent=reference_A)
            rises_A.append(before_A - bench.command_A)
        assert bench.command_A == pytest.approx(reference_A, abs=0.0021)
    assert max(rises_A[:30]) == pytest.approx(growth_A, abs=0.0021)
    assert max(rises_A[30:]) == pytest.approx(0.006 * 23.0, abs=0.0021)


def test_current_falls_at_once_and_rises_slowly_where_a_limit_was_met() -> None:
    bench = Bench()
    bench.start_at_full_current()
    # So hot that the way back is long enough for the rise to become as fast as it may.
    bench.period(SurfaceTemperature=319.0, CoolantTemperature=312.0)
    met_A = bench.command_A
    assert -8.0 < met_A < 0.0
    assert bench.state == "Derated"
    assert met_A == pytest.approx(bench.answer["LowerCurrent"], abs=0.0021)
    most_A = -0.006 * bench.ecu.preset.limits.reference_current_A
    rises_A = []
    for _ in range(100):
        before_A = bench.command_A
        bench.period(SurfaceTemperature=312.0, CoolantTemperature=306.0)
        rises_A.append(before_A - bench.command_A)
        assert rises_A[-1] <= most_A + 0.0021
    assert max(rises_A[:8]) <= 0.4 * most_A
    assert max(rises_A) >= 0.9 * most_A
