"""A pack of one cell is the ECU's own control core, bit for bit."""

import numpy as np
import pytest

from bms.model.pair import load_pair
from bms.presets.schema import Initial
from hil_sim.bus.catalog import Mode
from hil_sim.plant.true_cell import nominal_cell
from hil_sim.studies.campaign.engine import CampaignCharge, Scenario
from hil_sim.studies.campaign.settings import CampaignSettings
from hil_sim.studies.pack._pack import lib
from tests.hil_sim.pack_rig import PackRig, core_of, same


def follow(preset_name, soc, temperature_K, periods, wrong=None):
    """Plays a charge of the ECU and gives a pack of one cell what the ECU has read.

    `wrong` has (sensor, error) of the reading of a period that is wrong.
    """
    preset, model = load_pair(preset_name, None)
    settings = CampaignSettings(preset, model, runs=1, mode=Mode.FIXED)
    cell = nominal_cell(preset, Initial(soc, temperature_K, 1.0))
    charge = CampaignCharge(Scenario(settings), "kan-rcbf", cell, np.zeros(4))
    rig = PackRig(core_of(preset_name), 1)
    rng = np.random.default_rng(1)
    bms, states, limits, symptoms = charge.fields.link.bms, set(), set(), set()
    for period in range(periods):
        charge.fields.bias = (0.0,) * 5
        if period in (wrong or {}):
            sensor, error = wrong[period]
            charge.fields.bias[sensor] = error
        charge.advance(rng.standard_normal((1, 5)), np.zeros((10, 4)))
        if not bms.has_started:
            continue  # the network has to see each message first; a pack is given readings
        m = bms.measurement
        rig.voltages, rig.surfaces = [m.voltage_V], [m.surface_temperature_K]
        rig.socs = [m.plug_in_soc]
        rig.step(
            current_A=m.current_A,
            coolant_in_K=m.coolant_temperature_K,
            coolant_out_K=m.coolant_temperature_K,
            cooling_power_W=m.cooling_power_W,
            charge=m.request == 1,
            reference_current_A=m.reference_current_A,
        )
        ecu, pack = bms.decision, rig.decision
        assert rig.pack.state == bms.state, period
        assert same(rig.pack.command_A, bms.command_A), period
        assert rig.pack.monitor.active == bms.monitor.active, period
        assert (pack.active, pack.feasible) == (ecu.active, ecu.feasible), period
        for name in ("current_A", "lower_A", "upper_A"):
            assert same(getattr(pack, name), getattr(ecu, name)), (period, name)
        assert all(same(pack.margins[i], ecu.margins[i]) for i in range(4)), period
        assert same(
            rig.pack.cell[0].estimate.core_temperature_K, bms.estimate.core_temperature_K
        ), period
        states.add(bms.state)
        limits.add(ecu.active)
        symptoms |= {i for i in range(32) if bms.monitor.active >> i & 1}
        if charge.is_over:
            break
    return states, limits, symptoms


@pytest.mark.parametrize(
    ("preset", "soc", "temperature_K"),
    [
        ("paper_calibrated", 0.6, 310.0),
        ("lin2014", 0.8, 314.0),
        ("a123_26650_10C", 0.7, 312.0),
    ],
)
def test_a_pack_of_one_cell_decides_as_the_ecu_bit_for_bit(preset, soc, temperature_K):
    states, limits, symptoms = follow(preset, soc, temperature_K, 6000)
    assert {1, 2, 3} <= states  # standby, charging, derated
    assert 4 in states  # complete
    assert len(limits) >= 3
    assert not symptoms


CURRENT, VOLTAGE, SURFACE, COOLANT, COOLING = range(5)


@pytest.mark.parametrize("preset", ["paper_calibrated", "a123_26650_10C"])
@pytest.mark.parametrize(
    ("sensor", "most", "seen"),
    [
        (CURRENT, 150.0, {"CURRENT_RANGE", "CURRENT_DEVIATION", "VOLTAGE_DEVIATION"}),
        (VOLTAGE, 3.0, {"VOLTAGE_RANGE", "VOLTAGE_DEVIATION", "OVER_VOLTAGE"}),
        (SURFACE, 90.0, {"SURFACE_RANGE", "SURFACE_OVER_TEMPERATURE", "SURFACE_DEFICIT"}),
        (COOLANT, 90.0, {"COOLANT_RANGE"}),
        (COOLING, 100.0, {"COOLING_RANGE"}),
    ],
)
def test_a_reading_that_is_wrong_has_the_symptoms_that_the_ecu_sees(preset, sensor, most, seen):
    """Single periods, with errors from the greatest to the least, both ways."""
    errors = [sign * most * (1.0 - i / 16) ** 2 for i in range(16) for sign in (1, -1)]
    wrong = {100 + 40 * i: (sensor, error) for i, error in enumerate(errors)}
    symptoms = follow(preset, 0.4, 305.0, max(wrong) + 12, wrong)[2]
    assert symptoms >= {getattr(lib, f"FAULT_{name}") for name in seen}
