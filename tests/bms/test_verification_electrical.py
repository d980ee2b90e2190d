"""Voltage and charge: margins cover what a hold can bring, and the certificates notice less."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bms.barrier.margins import charge_taken_up, sampling_margins, strongest_current_A
from bms.barrier.readings import soc_error_bound, soc_reserve
from bms.barrier.rounding import rounding_allowances
from bms.bus_signals import BUS
from bms.firmware import Firmware
from bms.presets import load_preset, one_cell_preset_names
from bms.verification.conditions import firmware_constants
from bms.verification.electrical import certify_soc, certify_voltage
from tests.bms.plausible_presets import model_for, other_cells, plausible_presets

OTHERS = other_cells()
MARGIN_FIELDS = ("voltage_margin_V", "soc_margin_per_s")


def with_limits(preset, **limits):
    return replace(preset, limits=replace(preset.limits, **limits))


@pytest.mark.parametrize(
    ("name", "max_voltage_V"),
    [*product(one_cell_preset_names(), [3.3, 3.4, 3.45, 3.5, 3.55, 3.6, 3.7])],
)
def test_shipped_cells_are_certified_at_any_voltage_limit(name, max_voltage_V):
    preset = with_limits(load_preset(name), max_voltage_V=max_voltage_V)

    certificate, left_V = certify_voltage(preset, firmware_constants(preset, model_for(preset)))

    assert certificate.holds and certificate.shortfall is None
    assert left_V >= 0.0


@pytest.mark.parametrize("name", OTHERS)
def test_charge_up_to_its_limit_is_certified(name):
    preset = with_limits(OTHERS[name], completion_soc=1.0)

    assert certify_soc(preset, firmware_constants(preset, model_for(preset))).holds


@settings(max_examples=30)
@given(plausible_presets())
def test_any_plausible_preset_has_margins_that_its_certificates_accept(preset):
    constants = firmware_constants(preset, model_for(preset))

    assert certify_voltage(preset, constants)[0].holds
    assert certify_soc(preset, constants).holds


@settings(max_examples=30)
@given(plausible_presets(), st.integers(0, 2**32 - 1))
def test_no_decision_of_the_firmware_passes_the_voltage_limit_within_its_hold(preset, seed):
    """Decisions in C for a cold cell; the true charge ahead by all that counting and hold allow."""
    firmware, cell, limits = Firmware(preset, model_for(preset)), preset.cell, preset.limits
    cold_K = preset.operating_box.surface_temperature_K[0]
    random = np.random.default_rng(seed)
    # Close together where the current begins to be limited, because the margin is tightest there.
    full_soc = float(
        cell.ocv.soc_at(limits.max_voltage_V + cell.ohmic_resistance_ohm * 2 * BUS.command_A)
    )
    ends = [*cell.ocv.soc, full_soc, limits.completion_soc]
    counted = np.concatenate(
        [random.uniform(0.0, 1.0, 60), *(np.array(ends) - d for d in (0, 1e-3))]
    )
    for soc in counted[(counted >= 0.0) & (counted < limits.completion_soc)]:
        decision = firmware.solve(
            soc=float(soc) + soc_reserve(cell, preset),
            core_temperature_K=cold_K,
            surface_temperature_K=cold_K,
            coolant_temperature_K=cold_K,
            cooling_power_W=0.0,
            reference_current_A=limits.reference_current_A,
        )
        if decision.current_A == 0.0:
            continue
        current_A = -decision.current_A + BUS.command_A
        timing = preset.timing
        charge_As = (
            timing.sampling_period_s * current_A - timing.delay_s * limits.reference_current_A
        )
        later_soc = soc + soc_error_bound(cell, preset) + charge_As / cell.capacity_As
        voltage_V = float(cell.ocv(later_soc)) + cell.ohmic_resistance_ohm * current_A
        assert voltage_V <= limits.max_voltage_V


LOWERED = {
    "arithmetic and bus": lambda preset: rounding_allowances(preset.cell, preset).voltage_V,
    "a millionth of the capacity": lambda preset: 1e-6 * _steepest_V(preset),
    "hold": lambda preset: (
        _flattest_V(preset)
        * charge_taken_up(preset.cell, preset, BUS, strongest_current_A(preset, BUS))
    ),
}
"""Less than each part of the margin by itself, in V."""


def _slopes_V(preset):
    ocv = preset.cell.ocv
    return np.diff(ocv.voltage_V) / np.diff(ocv.soc)


def _steepest_V(preset):
    return float(np.max(_slopes_V(preset)))


def _flattest_V(preset):
    return float(np.min(_slopes_V(preset)))


@pytest.mark.parametrize("part", LOWERED)
@pytest.mark.parametrize("name", OTHERS)
def test_a_voltage_margin_without_one_of_its_parts_is_refused(name, part):
    preset = with_limits(OTHERS[name], max_voltage_V=3.3)
    constants = firmware_constants(preset, model_for(preset))
    assert certify_voltage(preset, constants)[0].holds
    constants["voltage_margin_V"] -= LOWERED[part](preset)

    certificate, left_V = certify_voltage(preset, constants)

    assert not certificate.holds
    assert certificate.shortfall.missing == pytest.approx(-left_V, abs=1e-8) and left_V < 0.0
    assert 0.0 <= certificate.shortfall.state["counted_soc"] <= preset.limits.completion_soc


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_a_count_that_decides_without_its_error_is_refused(name):
    preset = load_preset(name)
    constants = firmware_constants(preset, model_for(preset))
    assert certify_voltage(preset, constants)[0].holds
    assert not certify_voltage(preset, constants | {"soc_error": 0.0})[0].holds
    charge = with_limits(OTHERS["nmc_pouch"], completion_soc=1.0)
    constants = firmware_constants(charge, model_for(charge))
    assert not certify_soc(charge, constants | {"soc_error": 0.0}).holds


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_the_voltage_certificate_has_hardly_more_room_than_it_states(name):
    """Up to what it leaves the margin may be lowered, and no more than a microvolt further."""
    preset = load_preset(name)
    constants = firmware_constants(preset, model_for(preset))
    margin_V, (_, left_V) = constants["voltage_margin_V"], certify_voltage(preset, constants)

    constants["voltage_margin_V"] = margin_V - 0.9 * left_V
    assert certify_voltage(preset, constants)[0].holds
    constants["voltage_margin_V"] = margin_V - left_V - 1e-6
    assert not certify_voltage(preset, constants)[0].holds


@pytest.mark.parametrize("name", OTHERS)
def test_the_worst_of_the_voltage_certificate_is_that_of_a_dense_search(name):
    preset = OTHERS[name]
    cell, limits = preset.cell, preset.limits
    constants = firmware_constants(preset, model_for(preset))
    counted = np.linspace(0.0, limits.completion_soc, 400_001)
    margins, allowance_V = (
        sampling_margins(cell, preset),
        rounding_allowances(cell, preset).voltage_V,
    )
    at_most = counted + soc_reserve(cell, preset)
    spare_V = limits.max_voltage_V - margins.voltage_V - cell.ocv(at_most)
    current_A = np.minimum(spare_V / cell.ohmic_resistance_ohm, -limits.reference_current_A)
    charges = current_A > 0.0
    later_soc = (
        counted + soc_error_bound(cell, preset) + (charge_taken_up(cell, preset, BUS, current_A))
    )
    voltage_V = cell.ocv(later_soc) + cell.ohmic_resistance_ohm * current_A

    _, left_V = certify_voltage(preset, constants)

    searched_V = limits.max_voltage_V - float(np.max(voltage_V[charges]))
    assert searched_V - 3.0 * allowance_V < left_V < searched_V


@pytest.mark.parametrize("field", ["alpha1_per_s", "max_soc", "soc_margin_per_s", "capacity_As"])
def test_a_charge_constant_that_is_a_little_wrong_is_refused(field):
    preset = with_limits(OTHERS["nmc_pouch"], completion_soc=1.0)
    constants = firmware_constants(preset, model_for(preset))
    assert certify_soc(preset, constants).holds
    towards = -1.0 if field == "soc_margin_per_s" else 1.0
    constants[field] *= 1.0 + towards * 2e-3

    certificate = certify_soc(preset, constants)

    assert not certificate.holds
    assert certificate.shortfall.missing > 0.0


@pytest.mark.parametrize("field", MARGIN_FIELDS)
def test_a_margin_that_is_no_number_is_refused(field):
    preset = with_limits(OTHERS["nmc_pouch"], completion_soc=1.0)
    constants = firmware_constants(preset, model_for(preset)) | {field: np.nan}

    found = (certify_voltage(preset, constants)[0], certify_soc(preset, constants))

    assert [certificate.holds for certificate in found] == [field != c for c in MARGIN_FIELDS]


def test_a_limit_below_the_whole_table_charges_nothing_and_is_certified():
    preset = with_limits(OTHERS["nmc_pouch"], max_voltage_V=2.9)

    certificate, left_V = certify_voltage(preset, firmware_constants(preset, model_for(preset)))

    assert certificate.holds and left_V == np.inf
