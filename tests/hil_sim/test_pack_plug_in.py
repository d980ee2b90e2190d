"""States of charge at plug-in that are of the past: no charge that is asked for anew overfills."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bms.model.pair import load_pair
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.plant import PackPlant, PackWire, obeyed_A
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import SUB_STEPS, Core
from tests.hil_sim.pack_rig import CHARGING, PackRig, ordinary

ROOT = Path(__file__).parents[2]
COMPLETE, FAULT = 4, 5
CELLS, START = 4, 0.93
READY, FULL_WITHIN = 25, 3000
"""Periods until an ECU has heard everything; in which a pack is full from START on."""


class Charger:
    """A pack on its bus; `told` is what the sender of states of charge at plug-in says."""

    def __init__(self, preset="paper_calibrated", soc=START, **changes):
        shipped, model = load_pair(preset, None)
        started = replace(shipped, initial=replace(shipped.initial, soc=soc))
        settings = PackChargeSettings(started, model, CELLS, seed=1, **changes)
        self.preset = shipped
        self.ecu, self.plant = PackEcu(settings), PackPlant(settings)
        self.wire = PackWire(settings, self.plant)
        self.offset_A = 0.0
        self.run(READY, charge=False)

    def tell(self, socs):
        for cell, soc in enumerate(socs):
            self.wire._socs[cell] = soc

    def run(self, periods, charge, until=lambda: False, load_A=None):
        """`load_A` is what another device draws, in place of what the charger supplies."""
        for period in range(periods):
            self.plant.measure()
            self.plant.measured.current_A += self.offset_A
            heard = self.wire.hear(self.ecu.exchange(self.wire.publish(charge)))
            self.plant.bleed(heard)
            if load_A is None:
                self.plant.hold(obeyed_A(heard))
            else:
                self.plant.fields.current_A = load_A
                plant = ffi.addressof(self.plant.fields, "plant")
                lib.plant_hold(plant, load_A, SUB_STEPS)
            if until():
                return period
        return periods

    def fill(self):
        """Charge until the ECU says full; the periods that it took."""
        periods = self.run(FULL_WITHIN, charge=True, until=lambda: self.state == COMPLETE)
        assert self.state == COMPLETE
        return periods

    @property
    def state(self):
        return self.ecu.state.pack.state

    @property
    def counted(self):
        return [self.ecu.state.pack.cell[i].soc.soc for i in range(CELLS)]

    @property
    def keeps_limits(self):
        """Whether no cell has truly been fuller, or had more voltage, than is allowed."""
        limits, peaks = self.preset.limits, self.plant.peaks()
        return (peaks[:, 0] <= limits.max_soc).all() and (peaks[:, 3] <= limits.max_voltage_V).all()


def asked_anew_with_old_pages():
    """Whether limits are kept by three charges, all with what was told for the first."""
    charger = Charger()
    for _ in range(3):
        charger.run(FULL_WITHIN, charge=True, until=lambda: charger.state in (COMPLETE, FAULT))
        charger.run(READY, charge=False)
    return charger.keeps_limits


def test_a_full_pack_that_is_asked_for_a_charge_by_old_pages_is_full_at_once():
    charger = Charger()
    assert charger.fill() > 100
    full = charger.plant.socs()
    charger.run(READY, charge=False)
    assert charger.fill() <= 2
    assert charger.plant.socs() == pytest.approx(full, abs=2e-4)


def test_no_limit_is_crossed_by_charges_that_are_asked_for_with_old_pages():
    """Believed, they would let the second one pass the voltage's limit by some 50 mV."""
    assert asked_anew_with_old_pages()


def test_one_cell_whose_value_is_old_beside_others_that_are_new_begins_where_it_was_counted():
    charger = Charger()
    charger.run(200, charge=True)
    charger.run(READY, charge=False)
    true = charger.plant.socs()
    charger.tell([START - 0.02, *true[1:]])
    charger.run(READY, charge=False)
    charger.run(2, charge=True)
    assert charger.state in CHARGING
    np.testing.assert_array_less(np.array(charger.plant.socs()) - 1e-3, charger.counted)
    assert charger.counted[1:] == pytest.approx(true[1:], abs=0.02)


def test_what_a_load_has_drawn_since_is_believed_when_it_is_told():
    """A load of 10 A is no command: a fault until the request is off, but it is counted."""
    charger = Charger()
    charger.fill()
    charger.run(400, charge=False, load_A=10.0)
    charger.run(READY, charge=False)
    true = charger.plant.socs()
    assert max(true) < 0.95
    charger.tell(true)
    charger.run(READY, charge=False)
    charger.run(2, charge=True)
    assert charger.state in CHARGING
    np.testing.assert_array_less(np.array(true) - 1e-3, charger.counted)
    assert charger.counted == pytest.approx(true, abs=0.04)
    charger.fill()
    assert charger.keeps_limits


def counted_at_rest(offset_A):
    """How far the counts move while a full pack stands for 100 s beside a sensor that is off."""
    charger = Charger()
    charger.fill()
    charger.run(READY, charge=False)
    before, charger.offset_A = charger.counted, offset_A
    charger.run(1000, charge=False)
    return max(abs(a - b) for a, b in zip(before, charger.counted, strict=True))


def test_the_sensors_offset_is_not_counted_while_a_pack_stands():
    """It would let each pack seem full, or empty, after some days."""
    assert counted_at_rest(0.05) == 0.0
    assert counted_at_rest(0.2) > 1e-4


def after_balancing(times_asked=1):
    """The counts with which a charge begins whose cells were bled since they were full.

    Before it, the charge may have been asked for while a cell that was not bled was full.
    """
    charger = Charger(bleed_ohm=10.0)
    charger.fill()
    charger.run(600, charge=True)
    bled = [charger.ecu.state.bled_soc[i] for i in range(CELLS)]
    counted = charger.counted
    charger.ecu.state.balance.resistor_ohm = 0.0
    if times_asked > 1:
        charger.ecu.state.bled_soc[counted.index(max(counted))] = 0.0
    for _ in range(times_asked):
        charger.run(READY, charge=False)
        charger.run(1, charge=True)
    return counted, bled, charger


def test_what_was_bled_is_not_taken_for_what_is_there():
    """A balanced pack can be filled up, and begins no lower than its cells are."""
    counted, bled, charger = after_balancing()
    assert max(bled) > 0.002
    expected = [a - b for a, b in zip(counted, bled, strict=True)]
    assert charger.counted == pytest.approx(expected, abs=2e-4)
    np.testing.assert_array_less(np.array(charger.plant.socs()) - 1e-3, charger.counted)
    assert charger.state in CHARGING
    assert max(charger.ecu.state.bled_soc[i] for i in range(CELLS)) == 0.0


def test_what_was_bled_is_taken_off_once_however_often_a_full_pack_is_asked():
    counted, bled, charger = after_balancing(times_asked=3)
    assert charger.state == COMPLETE
    fullest = counted.index(max(counted))
    expected = [a - (0.0 if i == fullest else b) for i, (a, b) in enumerate(zip(counted, bled))]
    assert charger.counted == pytest.approx(expected, abs=2e-4)


def hottest_bound_K(first_soc):
    """Of a cell without a thermistor told to be at 0.5, after a charge that began at another."""
    core = Core(*load_pair("paper_calibrated", None), ordinary("paper_calibrated"))
    rig = PackRig(core, 2, bare=(1,))
    preset = core.preset
    rig.step(30, reference_current_A=-10.0)  # that nothing limits
    if first_soc is not None:
        rig.socs = [first_soc] * 2
        rig.voltages = [preset.cell.ocv(first_soc)] * 2
        rig.step(1, charge=True)
        assert rig.pack.soc_known
        rig.step(2, charge=False)
    rig.socs = [0.5] * 2
    rig.voltages = [preset.cell.ocv(0.5)] * 2
    rig.step(1, charge=True)
    for _ in range(100):
        current_A = rig.pack.command_A
        ohm = preset.cell.ohmic_resistance_ohm
        rig.voltages = [preset.cell.ocv(0.5) - current_A * ohm] * 2
        rig.step(1, current_A=current_A)
    assert rig.pack.command_A == pytest.approx(-10.0)
    return rig.pack.cell[1].surface_temperature_K


def test_a_cell_without_a_thermistor_is_believed_no_cooler_for_what_was_counted():
    """A fuller cell would explain its voltage by less resistance."""
    assert hottest_bound_K(0.55) >= hottest_bound_K(None) - 1e-4


def family_bounds():
    """Bounds of a family's cells and where they are, when a charge begins with old pages."""
    charger = Charger("a123_26650_10C", soc=0.3)
    charger.run(1000, charge=True)
    charger.run(READY, charge=False)
    charger.run(1, charge=True)
    assert charger.state in CHARGING
    family = charger.ecu.state.pack.family
    high = [family[i].soc_high.soc for i in range(CELLS)]
    low = [family[i].soc_low.soc for i in range(CELLS)]
    return low, charger.plant.socs(), high


def test_a_familys_bounds_hold_what_was_counted_as_well():
    low, true, high = family_bounds()
    assert min(true) > 0.4
    np.testing.assert_array_less(true, high)
    np.testing.assert_array_less(low, true)


RULES = {
    "old pages": asked_anew_with_old_pages,
    "rest": lambda: counted_at_rest(0.05) == 0.0,
    "bled": lambda: after_balancing()[2].state in CHARGING,
    "resistance": lambda: hottest_bound_K(0.55) >= hottest_bound_K(None) - 1e-4,
    "family": lambda: min(np.subtract(*family_bounds()[:0:-1])) > 0.0,
}
CELL, ECU = "firmware_c/pack/pack_cell.c", "firmware_c/pack_ecu/pack_ecu.c"
BROKEN = {
    "old pages": (CELL, "numeric_larger(cell->soc.soc - bled_soc, told_soc)", "told_soc"),
    "rest": (CELL, "fabsf(current_A) > PACK_REST_A", "true"),
    "bled": (ECU, ".bled_soc = ecu->bled_soc,", ""),
    "resistance": (CELL, " - cell->untold_soc", ""),
    "family": (CELL, "pack->cell[index].untold_soc > 0.0f", "false"),
}


@pytest.mark.slow
@pytest.mark.parametrize("broken", BROKEN)
def test_without_its_rule_a_mutant_is_red(tmp_path, broken):
    source, text, other = BROKEN[broken]
    tree = tmp_path / "tree"
    for folder in ("firmware_c", "hil_sim/native", "hil_sim/studies/pack/native"):
        shutil.copytree(ROOT / folder, tree / folder)
    original = (tree / source).read_text()
    assert original.count(text) == 1
    (tree / source).write_text(original.replace(text, other))
    command = [sys.executable, "-m", "tests.hil_sim.plug_in_mutant", tree, tmp_path / "out", broken]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().splitlines()[-1] == "broken"
