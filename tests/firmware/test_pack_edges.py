"""A pack's core where cells contradict each other, nothing is known yet, or a number is none."""

from __future__ import annotations

import math
from copy import copy
from functools import cache
from typing import Any

import numpy as np
import pytest

from bms.cell import CellFactors
from bms.model.pair import load_pair
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import Core
from hil_sim.studies.pack.reserves import NO_RESERVES
from tests.hil_sim.pack_rig import PackLoop, PackRig, ordinary

ONE_CELL, FAMILY = "paper_calibrated", "a123_26650_10C"
WORST_K = ("surface_K", "estimate_K", "coolant_K")


@cache
def shipped(preset: str, has_bare: bool) -> Core:
    """Constants of a preset, with the bound of a cell without a thermistor where there is one."""
    return Core(*load_pair(preset, None), ordinary(preset) if has_bare else NO_RESERVES)


def own_core(preset: str, has_bare: bool = False) -> Core:
    """Constants whose numbers a test may change."""
    core = copy(shipped(preset, has_bare))
    own = ffi.new("bms_calibration_t *", core.calibration[0])
    object.__setattr__(core, "calibration", own)
    return core


def fresh(preset: str, cells: int, **options: Any) -> PackRig:
    """A pack with a calibration of its own."""
    return PackRig(own_core(preset, bool(options.get("bare"))), cells, **options)


def bit(*names: str) -> int:
    return sum(1 << getattr(lib, f"FAULT_{name}") for name in names)


def charging(preset: str, cells: int = 2, **options: Any) -> PackRig:
    """A pack in the first period of a charge from half full, at 300 K."""
    rig = fresh(preset, cells, **options)
    rig.surfaces = [300.0] * len(rig.surfaces)
    rig.socs = [0.5] * cells
    rig.voltages = [rig.core.preset.cell.ocv(0.5)] * cells
    rig.step(60, coolant_in_K=300.0, coolant_out_K=300.0)
    rig.step(charge=True)
    assert rig.pack.state == lib.BMS_CHARGING
    return rig


def hot_beside_full(hot: int, strength_A: float) -> tuple[PackRig, float]:
    """A pack of two cells, and the least current in A that the hot one has to be charged with.

    It cools by that; the other one has room for no more than `strength_A`, since it is full soon.
    """
    rig = fresh(ONE_CELL, 2)
    calibration, k = rig.core.calibration, rig.core.calibration.rcbf
    k.a2_per_As, k.estimation_error_bound_K = -2e-5, 0.0
    k.core_margin_K_per_s = k.soc_margin_per_s = k.soc_uncertainty_per_s = 0.0
    k.max_core_temperature_K = (304.75, 0.0)
    calibration.current_growth_A, calibration.completion_soc = 20.0, 1.0
    calibration.soc_error, calibration.plausibility.temperature_overshoot_K = 0.0, 5.0
    rig.surfaces = [300.0, 300.0]
    rig.surfaces[hot] = 305.0
    rig.socs = [0.3, 0.3]
    rig.socs[1 - hot] = 0.6
    k.max_soc = 0.6 + strength_A / k.capacity_As / k.alpha1_per_s
    rig.voltages = [rig.core.preset.cell.ocv(soc) for soc in rig.socs]
    rig.step(60, coolant_in_K=300.0, coolant_out_K=300.0)
    rig.step(charge=True)
    core_K = rig.pack.cell[hot].estimate.core_temperature_K
    left = k.a1_per_s * (304.75 - 305.0) - k.core_uncertainty_K_per_s
    roots = np.roots([-k.a3_K_per_A2s, k.a2_per_As * core_K, left])
    return rig, float(-max(roots))


@pytest.mark.parametrize("hot", [0, 1])
def test_cells_of_which_one_needs_more_than_another_bears_get_nothing(hot: int) -> None:
    """What the one needs is the root of its condition; which of them is first does not matter."""
    _, least_A = hot_beside_full(hot, 5.0)
    assert 0.5 < least_A < 3.0
    rig, _ = hot_beside_full(hot, 1.02 * least_A)
    assert rig.decision.feasible and rig.decision.active == lib.RCBF_SOC
    assert rig.pack.decision.cell == 1 - hot
    assert rig.pack.command_A == pytest.approx(-1.02 * least_A, rel=5e-3)
    assert rig.decision.lower_A <= rig.decision.upper_A
    assert rig.decision.upper_A == pytest.approx(-least_A, rel=5e-3)
    rig, _ = hot_beside_full(hot, 0.98 * least_A)
    for cell in range(2):
        assert rig.own_decision(cell, -20.0).feasible, "each by itself has a current"
    assert not rig.decision.feasible and rig.decision.active == lib.RCBF_INFEASIBLE
    assert (rig.decision.current_A, rig.pack.command_A) == (0.0, 0.0)


@pytest.mark.parametrize("map_", [(), (0,), (2,)])
def test_until_every_thermistor_s_cell_has_settled_a_pack_is_not_ready(map_: tuple[int]) -> None:
    """A cell without a thermistor has no history, and nobody waits for it."""
    rig = fresh(ONE_CELL, 3, bare=map_)
    rig.core.calibration.kan.settling_periods = 8
    for period in range(1, 12):
        assert rig.step(charge=True) == 0.0
        assert rig.pack.state == (lib.BMS_INIT if period < 8 else lib.BMS_STANDBY), period
        assert rig.pack.monitor.active == 0, "what the estimator does not know yet is no symptom"


@pytest.mark.parametrize("broken", [0, 1])
def test_one_cell_that_settles_keeps_a_pack_from_ready_whatever_the_other_does(broken: int) -> None:
    """The thermistor that reads nothing has no history to settle; its fault is one all the same."""
    rig = fresh(ONE_CELL, 2)
    rig.core.calibration.kan.settling_periods = 8
    rig.surfaces[broken] = math.nan
    states = []
    for _ in range(8):
        assert rig.step() == 0.0
        states.append(rig.pack.state)
    assert states == [lib.BMS_INIT] * 2 + [lib.BMS_FAULT] * 6
    assert rig.pack.monitor.latched & bit("SURFACE_RANGE")
    assert rig.pack.symptom_cell == broken


def test_a_fault_is_left_with_the_request_off_and_no_symptom_and_not_before() -> None:
    rig = charging(ONE_CELL)
    rig.step(3, current_A=math.nan)
    assert rig.pack.state == lib.BMS_FAULT
    rig.step(2, current_A=0.0)
    assert rig.pack.state == lib.BMS_FAULT, "as long as a charge is asked for"
    rig.step(charge=False, current_A=math.nan)
    assert rig.pack.state == lib.BMS_FAULT, "while there is a symptom"
    rig.step(current_A=0.0)
    assert (rig.pack.state, rig.pack.monitor.latched) == (lib.BMS_STANDBY, 0)


def test_a_charge_begins_once_for_each_time_that_it_is_asked_for_and_with_no_symptom() -> None:
    rig = fresh(ONE_CELL, 2)
    rig.step(10, charge=True)
    assert rig.pack.state == lib.BMS_STANDBY, "its request was never off"
    rig.step(charge=False)
    rig.step(charge=True, cooling_power_W=math.nan)
    assert rig.pack.state == lib.BMS_STANDBY, "with a symptom"
    rig.step(cooling_power_W=1.0)
    assert rig.pack.state == lib.BMS_CHARGING


@pytest.mark.parametrize("soc", [-1e-6, math.nan, math.inf, 1.0001])
def test_a_state_of_charge_that_cannot_be_makes_a_request_invalid_of_whatever_cell(
    soc: float,
) -> None:
    for cell in range(3):
        rig = fresh(ONE_CELL, 3)
        rig.step(10)
        told = list(rig.socs)
        rig.socs[cell] = soc
        rig.step(charge=True)
        assert (rig.pack.state, rig.pack.monitor.active) == (
            lib.BMS_STANDBY,
            bit("REQUEST_INVALID"),
        )
        rig.socs = told
        rig.step()
        assert rig.pack.state == lib.BMS_CHARGING


def test_a_decision_that_is_none_without_any_symptom_is_a_symptom_itself() -> None:
    """A count that memory has lost; the cell is named, the current ends at once."""
    rig = charging(ONE_CELL, 3)
    rig.step(2, current_A=rig.pack.command_A)
    assert rig.pack.command_A < 0.0 and rig.pack.monitor.active == 0
    lib.soc_set(ffi.addressof(rig.pack.cell[1], "soc"), math.nan)
    assert rig.step(current_A=rig.pack.command_A) == 0.0
    assert rig.pack.monitor.active & bit("DECISION_INVALID")
    assert not lib.monitor_stops(rig.pack.monitor.active & ~bit("DECISION_INVALID"))
    assert rig.decision.active == lib.RCBF_INVALID and rig.pack.decision.cell == 1
    rig.step(current_A=0.0)
    assert rig.pack.state == lib.BMS_FAULT
    assert rig.pack.monitor.first == lib.FAULT_DECISION_INVALID


INPUTS = ("current_A", "cooling_power_W", "surface", "coolant")


def estimated(name: str, value: float, beside_K: float) -> tuple[float, bool]:
    """A cell's first estimate in K, and whether it is one, at a value of the input of that name.

    Surface and coolant, where they are not that input, are at `beside_K`.
    """
    rig = fresh(ONE_CELL, 1)
    surface_K = value if name == "surface" else beside_K
    coolant_K = value if name == "coolant" else beside_K
    others = {name: value} if name not in ("surface", "coolant") else {}
    rig.surfaces = [surface_K]
    rig.step(coolant_in_K=coolant_K, coolant_out_K=coolant_K, **others)
    estimate = rig.pack.cell[0].estimate
    return estimate.core_temperature_K, estimate.in_domain


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("name", INPUTS)
def test_a_reading_outside_of_the_box_by_its_error_is_one_on_the_face_and_beyond_it_is_none(
    name: str, side: int
) -> None:
    calibration = fresh(ONE_CELL, 1).core.calibration
    index = INPUTS.index(name)
    reach = 1.0 / calibration.kan.input_scale[index]
    face = calibration.kan.input_center[index] + side * reach
    error = calibration.plausibility.reading_error[index]
    beside_K = min(max(face, 279.0), 323.0) if name in ("surface", "coolant") else 300.0
    at, near, beyond = (
        estimated(name, face + side * error * share, beside_K) for share in (0.0, 0.9, 1.2)
    )
    assert (at[1], near[1], beyond[1]) == (True, True, False)
    assert near[0] == at[0]


@pytest.mark.parametrize("bare", [(), (1,)])
@pytest.mark.parametrize("missing", ["surface", "coolant_in_K", "coolant_out_K"])
def test_a_cell_s_temperatures_begin_with_the_first_surface_and_coolant_that_are_usable(
    missing: str, bare: tuple[int]
) -> None:
    """A cell without a thermistor begins with those of the others."""
    rig = fresh(ONE_CELL, 2, bare=bare)
    cell, good, start_K = rig.pack.cell[1], rig.readings["coolant_in_K"], rig.surfaces[0]
    last = len(rig.surfaces) - 1

    def read(value: float) -> None:
        if missing == "surface":
            rig.surfaces[last] = value
            rig.step()
        else:
            rig.step(**{missing: value})

    for broken in (math.nan, 1000.0):
        read(broken)
        assert not cell.thermal.is_known
        assert rig.pack.monitor.stop
    read(start_K if missing == "surface" else good)
    assert cell.thermal.is_known and cell.estimate.in_domain
    assert cell.thermal.start_K == pytest.approx(start_K)
    read(math.nan)
    assert cell.thermal.is_known, "from then on it is carried on"


def driven(cells: int = 2) -> PackLoop:
    """A family's pack beside a plant, long enough in a charge that its cores are known."""
    loop = PackLoop(own_core(FAMILY), [CellFactors()] * cells, soc=0.3, temperature_K=300.0)
    loop.run(50)
    assert loop.pack.state == lib.BMS_CHARGING and loop.pack.family[1].core_is_known
    return loop


def test_a_cell_of_a_family_that_may_be_too_hot_is_a_fault_in_a_charge_alone() -> None:
    """Above its limit by more than the overshoot, to both sides of what the observer leaves."""
    loop = driven()
    limits, current_A = loop.core.calibration.plausibility, loop.pack.command_A

    def is_seen(beyond_K: float) -> bool:
        limits.temperature_overshoot_K = -loop.pack.family[1].core_room_K - beyond_K
        loop.step(current_A=current_A)
        return bool(loop.pack.monitor.active & bit("CORE_OVER_TEMPERATURE"))

    assert (is_seen(-0.2), is_seen(0.2)) == (False, True)
    loop.step(30, charge=False, current_A=0.0)
    assert loop.pack.family[1].core_is_known
    assert not is_seen(0.2)


@pytest.mark.parametrize(("counted", "told"), [(0.5, 0.4), (0.5, 0.6), (0.985, 0.5)])
def test_a_family_s_cell_that_was_counted_fuller_than_it_is_told_is_bounded_by_the_count(
    counted: float, told: float
) -> None:
    """By the error of what is told above it, and never by more than full."""
    rig = charging(FAMILY)
    rig.step(charge=False)
    for cell in range(2):
        lib.soc_set(ffi.addressof(rig.pack.cell[cell], "soc"), counted)
    rig.socs = [told, told]
    rig.voltages = [rig.core.preset.cell.ocv(told)] * 2
    rig.step(20)
    rig.step(charge=True)
    assert rig.pack.state in (lib.BMS_CHARGING, lib.BMS_DERATED)
    error = rig.core.calibration.family.plug_in_error
    for cell in range(2):
        assert rig.pack.cell[cell].soc.soc == pytest.approx(max(counted, told))
        assert rig.pack.cell[cell].untold_soc == pytest.approx(max(counted - told, 0.0), abs=1e-6)
        high = rig.pack.family[cell].soc_high.soc
        if counted > told:
            assert high == pytest.approx(min(counted + error, 1.0), abs=1e-6)
        else:
            assert high <= told + error + 1e-6


@pytest.mark.parametrize(
    ("told", "bled", "begun"),
    [
        (0.4, None, [0.6, 0.6]),
        (0.4, [0.0, 0.1], [0.6, 0.5]),
        (0.55, [0.02, 0.1], [0.58, 0.55]),
        (0.7, [0.0, 0.1], [0.7, 0.7]),
    ],
)
def test_a_charge_begins_at_what_is_told_or_was_counted_less_what_was_bled_whichever_is_more(
    told: float, bled: list[float] | None, begun: list[float]
) -> None:
    rig = charging(ONE_CELL)
    rig.step(charge=False)
    for cell in range(2):
        lib.soc_set(ffi.addressof(rig.pack.cell[cell], "soc"), 0.6)
    kept = ffi.NULL if bled is None else ffi.new("float[]", bled)
    rig.socs = [told, told]
    rig.voltages = [rig.core.preset.cell.ocv(soc) for soc in begun]
    rig.step(charge=True, bled_soc=kept)
    assert rig.pack.state == lib.BMS_CHARGING
    counted = [rig.pack.cell[cell].soc.soc for cell in range(2)]
    assert counted == pytest.approx(begun, abs=1e-6)
    untold = [rig.pack.cell[cell].untold_soc for cell in range(2)]
    assert untold == pytest.approx([soc - told for soc in begun], abs=1e-6)


@pytest.mark.parametrize(("preset", "is_allowed"), [(ONE_CELL, True), (FAMILY, False)])
def test_ahead_a_family_is_allowed_nothing_since_no_cell_stands_for_its_cells(
    preset: str, is_allowed: bool
) -> None:
    rig = charging(preset)
    worst = ffi.new("pack_worst_t *", {"soc": 0.5} | dict.fromkeys(WORST_K, 300.0))
    horizon = ffi.new("pack_horizon_t *", {"horizon_s": 10.0})
    allowed_A = lib.pack_function_A(rig.pack, worst, horizon)
    assert (allowed_A < 0.0) is is_allowed
    assert is_allowed or allowed_A == 0.0


def test_no_command_is_stronger_than_the_calibration_s_strongest_by_a_rounding() -> None:
    """A family's decision goes by what the charger gives at most, and back: a step of float32."""
    loop = driven()
    loop.core.calibration.reference_current_A = -7.9
    strongest_A = loop.core.calibration.reference_current_A
    commands, decided = [], []
    for _ in range(300):
        commands += loop.run(1)
        decided.append(loop.decision.current_A)
    assert min(decided) < strongest_A, "nothing was rounded; the test says nothing"
    assert min(decided) == pytest.approx(strongest_A, rel=1e-6)
    assert min(commands) == strongest_A
