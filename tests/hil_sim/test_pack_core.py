"""The pack's current lies in every cell's own interval, and is the end of the weakest one's."""

import math

import numpy as np
import pytest

from bms.cell import CellFactors
from bms.model.pair import load_pair
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import NO_CELL, NO_THERMISTOR, Core
from tests.hil_sim.pack_rig import CHARGING, PackLoop, PackRig, core_of, ordinary

FAULT, COMPLETE = 5, 4
VOLTAGE, CORE, INFEASIBLE = 1, 3, 5  # rcbf_active_t
HOT_K = {"paper_calibrated": 315.0, "lin2014": 318.0, "a123_26650_10C": 314.0}
PRESETS = tuple(HOT_K)
BARE = ordinary("paper_calibrated").bare


def loop_of(preset, worse=(), cells=5, **start):
    """A charge of cells of which some have more resistance."""
    factors = [CellFactors(resistance=1.1 if i in worse else 1.0) for i in range(cells)]
    return PackLoop(core_of(preset), factors, **start)


@pytest.mark.parametrize("preset", PRESETS)
def test_the_current_is_in_the_interval_of_each_cell_by_itself(preset):
    loop = loop_of(preset, worse=(1, 3), temperature_K=HOT_K[preset])
    limited = 0
    for _ in range(600):
        command = loop.run(1)[0]
        limited += loop.pack.decision.cell != NO_CELL
        for cell in range(5):
            own = loop.own_decision(cell, command)
            assert own.feasible
            assert own.current_A == pytest.approx(command, rel=1e-6), cell
    assert limited > 100


@pytest.mark.parametrize("worst", [0, 2, 4])
@pytest.mark.parametrize("preset", PRESETS)
def test_the_cell_that_heats_most_governs_and_is_named(preset, worst):
    loop = loop_of(preset, worse=(worst,), temperature_K=HOT_K[preset])
    named = 0
    for _ in range(600):
        command = loop.run(1)[0]
        named += loop.pack.decision.cell == worst and loop.decision.active in (VOLTAGE, CORE)
    assert named > 100
    assert loop.pack.decision.cell == worst
    # Each cell by itself, asked for more: the worst one gives what the pack was given, or less by
    # what keeps the noise out of it, and the others leave more.
    alone_A = [loop.own_decision(cell, command - 2.0).current_A for cell in range(5)]
    assert alone_A[worst] == pytest.approx(command, abs=0.7)
    assert all(other < alone_A[worst] - 0.5 for i, other in enumerate(alone_A) if i != worst)


def test_without_a_limit_no_cell_is_named():
    loop = loop_of("paper_calibrated", temperature_K=285.0)
    loop.run(5)
    assert (loop.pack.decision.cell, loop.decision.active) == (NO_CELL, 0)


@pytest.mark.parametrize("preset", PRESETS)
def test_the_order_of_the_cells_does_not_matter(preset):
    commands = [
        loop_of(preset, worse=(4,), temperature_K=HOT_K[preset], order=order).run(400)
        for order in ([0, 1, 2, 3, 4], [3, 4, 0, 1, 2])
    ]
    # A family's cell takes a weaker reference for what may flow until the next decision.
    assert commands[0] == pytest.approx(commands[1], rel=1e-3)
    assert min(commands[0]) < -10.0


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("broken", [math.nan, math.inf])
@pytest.mark.parametrize(
    "reading",
    ["current_A", "coolant_in_K", "coolant_out_K", "cooling_power_W", "voltages", "surfaces"],
)
def test_a_reading_of_any_cell_that_is_none_allows_no_current_in_its_period(
    preset, reading, broken
):
    for cell in (0, 3):
        rig = loop_of(preset, cells=4)
        assert rig.run(20)[-1] < 0.0
        current = rig.pack.command_A
        if reading in ("voltages", "surfaces"):
            getattr(rig, reading)[cell] = broken
            assert rig.step(current_A=current) == 0.0
            assert rig.pack.symptom_cell == cell
        else:
            assert rig.step(**{"current_A": current, reading: broken}) == 0.0


@pytest.mark.parametrize("asked_A", [math.nan, math.inf, 0.5])
def test_a_request_that_makes_no_charge_is_refused_by_the_decision_too(asked_A):
    """As well as by its symptom: neither relies on the other."""
    rig = loop_of("paper_calibrated", cells=3)
    current_A = rig.run(20)[-1]
    assert rig.step(current_A=current_A, reference_current_A=asked_A) == 0.0
    assert not rig.decision.feasible and rig.decision.current_A == 0.0
    assert rig.decision.active == lib.RCBF_INVALID
    assert rig.pack.monitor.active == 1 << lib.FAULT_REQUEST_INVALID


def test_a_reading_that_comes_back_lets_the_charge_go_on_and_one_that_stays_out_is_a_fault():
    rig = loop_of("paper_calibrated", cells=4)
    rig.run(20)
    good = rig.voltages[2]
    rig.voltages[2] = math.nan
    rig.step(2, current_A=0.0)
    rig.voltages[2] = good
    rig.step(1, current_A=0.0)
    assert rig.pack.state in CHARGING
    assert rig.pack.command_A < 0.0
    rig.voltages[2] = math.nan
    rig.step(3, current_A=0.0)
    assert rig.pack.state == FAULT


def test_the_pack_is_full_when_its_fullest_cell_is():
    loop = PackLoop(
        core_of("paper_calibrated"), [CellFactors()] * 3, soc=0.985, temperature_K=300.0
    )
    for index, soc in enumerate((0.3, 0.985, 0.5)):
        soc_set(loop, index, soc)
    counted = []
    while loop.pack.state in CHARGING and len(counted) < 600:
        loop.run(1)
        counted.append(loop.pack.cell[1].soc.soc)
    assert loop.pack.state == COMPLETE
    assert loop.pack.command_A == 0.0
    assert counted[-1] >= 0.99 > counted[-2]
    spread = lib.pack_soc_spread(loop.pack)
    assert spread.low == pytest.approx(loop.pack.cell[0].soc.soc) and spread.low < 0.35
    assert spread.high == pytest.approx(counted[-1])


def soc_set(loop, index, soc):
    """The cell has this state of charge, and the core knows it."""
    loop.plant.cell[index].memory.state.soc = soc
    counter = ffi.addressof(loop.pack.cell[index], "soc")
    lib.soc_set(counter, soc)


@pytest.mark.parametrize(
    ("cells", "map_", "thermistors"),
    [
        (0, [], 0),
        (193, [NO_THERMISTOR] * 193, 1),
        (2, [0, 0], 1),  # two cells by one thermistor
        (2, [0, 2], 2),  # a thermistor that is none
        (2, [0, 1], 3),  # a thermistor that is at no cell
        (2, [0, 1], 300),  # more than a pack has room for
        (2, [NO_THERMISTOR] * 2, 0),  # nothing is measured
    ],
)
def test_a_pack_that_cannot_be_is_refused_for_good(cells, map_, thermistors):
    assert state_of("paper_calibrated", BARE, cells, map_, thermistors) == FAULT


@pytest.mark.parametrize(
    ("preset", "bare", "state"),
    [
        ("paper_calibrated", BARE, 0),
        ("paper_calibrated", BARE | {"surface_K": math.nan}, FAULT),
        ("paper_calibrated", BARE | {"resistance_factor": 0.0}, FAULT),
        ("a123_26650_10C", BARE, FAULT),  # a family needs them all
    ],
)
def test_a_cell_without_a_thermistor_needs_constants_and_no_family(preset, bare, state):
    assert (state_of(preset, bare, 2, [0, NO_THERMISTOR], 1) == FAULT) == (state == FAULT)


def state_of(preset, bare, cells, map_, thermistors):
    """State after a first period with readings of the preset's start."""
    core = core_of(preset)
    pack = ffi.new("pack_t *")
    kept_map = ffi.new("uint8_t[]", map_ or [0])
    config = {
        "calibration": core.calibration,
        "cells": cells,
        "thermistors": thermistors,
        "thermistor_of": kept_map,
        "bare": bare,
    }
    lib.pack_init(pack, ffi.new("pack_config_t *", config))
    start = core.preset.initial
    many = max(cells, thermistors, 1)
    arrays = [
        ffi.new("float[]", [value] * many)
        for value in (core.preset.cell.ocv(start.soc), start.temperature_K, start.soc)
    ]
    readings = {
        "voltage_V": arrays[0],
        "surface_temperature_K": arrays[1],
        "plug_in_soc": arrays[2],
        "coolant_in_K": start.temperature_K,
        "coolant_out_K": start.temperature_K,
        "cooling_power_W": start.cooling_power_W,
    }
    lib.pack_step(pack, ffi.new("pack_readings_t *", readings))
    assert pack.command_A == 0.0
    return pack.state


def test_the_first_cell_that_admits_no_current_refuses_it_for_all_and_is_named():
    loop = loop_of("paper_calibrated", temperature_K=HOT_K["paper_calibrated"])
    loop.run(300)
    limit_K = loop.core.preset.limits.max_core_temperature_K
    for cell in (1, 3):
        state = loop.plant.cell[cell].memory.state
        state.surface, state.core = limit_K + 2.0, limit_K + 2.0
    assert loop.run(1) == [0.0]
    assert not loop.decision.feasible
    assert (loop.decision.active, loop.pack.decision.cell) == (INFEASIBLE, 1)


def test_the_surface_of_a_bare_cell_is_bounded_by_the_heat_that_its_own_voltage_admits():
    """Of the linear model from the hottest reading, with the warmest coolant that passes it."""
    preset, model = load_pair("paper_calibrated", None)
    rig = PackRig(Core(preset, model, ordinary("paper_calibrated")), 3, bare=(1,))
    bare, k = rig.core.reserves.bare, rig.pack.calibration
    thermal, cell = k.thermal, rig.pack.cell[1]
    matrix = np.array(list(thermal.transition)).reshape(2, 2)
    gain_heat, gain_coolant = (
        np.array(list(thermal.gain_K_per_W)),
        np.array(list(thermal.gain_coolant)),
    )
    most_ohm = bare["resistance_factor"] * thermal.ohmic_resistance_ohm
    inlet_K, outlet_K, start_K = 297.0, 303.0, 305.0
    rig.surfaces, greatest_W = [301.0, start_K], 0.0
    rig.step(coolant_in_K=inlet_K, coolant_out_K=outlet_K)
    rig.step(charge=True)
    assert rig.pack.soc_known and cell.thermal.is_known
    rise = gain_coolant * (inlet_K + 2.0 / 3.0 * (outlet_K - inlet_K) - start_K)
    seen = set()
    for current_A, above_V in [(0.0, 0.0), (-20.0, 0.9), (-12.0, 0.05), (-6.0, -0.2), (-9.0, 0.3)]:
        soc = cell.soc.soc
        rig.voltages[1] = (
            lib.rcbf_open_circuit_voltage_V(ffi.addressof(k, "rcbf"), soc - bare["soc_error"])
            + above_V
        )
        rig.step(current_A=current_A)
        strength_A = -current_A - bare["current_error_A"]
        ohm = most_ohm
        if strength_A > 0.0:
            ohm = min(most_ohm, max(0.0, (above_V + bare["voltage_error_V"]) / strength_A))
        seen.add("most" if ohm == most_ohm else "none" if ohm == 0.0 else "seen")

        def heat_W(core_rise_K, ohm=ohm, current_A=current_A):
            entropic_V = thermal.entropic_coefficient_V_per_K * (start_K + core_rise_K)
            return ohm * current_A**2 - entropic_V * current_A

        coolant_K = inlet_K + 2.0 / 3.0 * (outlet_K - inlet_K) - start_K
        rise = matrix @ rise + gain_heat * heat_W(rise[0]) + gain_coolant * coolant_K
        greatest_W = max(greatest_W, heat_W(rise[0]))
        assert cell.greatest_heat_W == pytest.approx(greatest_W, rel=1e-3, abs=1e-3)
        assert cell.estimate.core_temperature_K == pytest.approx(start_K + rise[0], abs=1e-3)
        above_K = bare["surface_K"] + bare["estimate_K"] + bare["surface_K_per_W"] * greatest_W
        assert cell.surface_temperature_K == pytest.approx(start_K + rise[1] + above_K, abs=1e-3)
    assert seen == {"most", "none", "seen"}
