"""Presets of cells of other sizes, filled in as from their data sheets and shapes."""

from __future__ import annotations

from dataclasses import dataclass

from bms.cell import CellInterval, CellParameters, OpenCircuitVoltage
from bms.cell.parameters import Branch
from bms.presets import Preset
from bms.presets.schema import (
    CurrentMap,
    Gains,
    Initial,
    Limits,
    OperatingBox,
    PlugIn,
    Sensor,
    Sensors,
    Supply,
    Timing,
    Uncertainty,
)
from tests.bms.plausible_presets import CURVES


@dataclass(frozen=True)
class Sheet:
    """What a data sheet and a shape say; heat resistances and capacities of the whole cell."""

    curve: str
    capacity_Ah: float
    max_voltage_V: float
    charge_A: float
    ohmic_ohm: float
    core_K_per_W: float
    surface_K_per_W: float
    heat_J_per_K: float


SHEETS = {
    "lto_18650_0.5Ah": Sheet("lto", 0.5, 2.8, 2.5, 0.045, 3.5, 15.0, 20.0),
    "nmc_21700_5Ah": Sheet("nmc", 5.0, 4.2, 5.0, 0.020, 3.0, 8.0, 65.0),
    "nmc_pouch_60Ah": Sheet("nmc", 60.0, 4.2, 120.0, 8.0e-4, 0.2, 0.4, 900.0),
    "lfp_prismatic_50Ah": Sheet("lfp", 50.0, 3.65, 50.0, 8.0e-4, 0.6, 1.0, 1300.0),
    "lfp_prismatic_280Ah": Sheet("lfp", 280.0, 3.65, 140.0, 2.0e-4, 0.25, 0.5, 5500.0),
    "lfp_prismatic_300Ah": Sheet("lfp", 300.0, 3.65, 300.0, 1.8e-4, 0.25, 0.5, 5800.0),
}
LIMIT_K, COLDEST_K = 323.15, 273.15
COMPLETION = 0.97
LARGEST_COOLING_W = 40.0
"""The signal on the CAN bus ends at 45.5 W."""
INTERVAL = CellInterval(
    core_resistance=(0.6, 1.6),
    core_heat_capacity=(0.8, 1.25),
    surface_resistance=(0.5, 2.0),
    surface_heat_capacity=(0.5, 2.0),
    coolant_heat_capacity=(0.5, 2.0),
    resistance=(0.8, 1.6),
    polarisation=(0.0, 1.6),
    capacity=(0.8, 1.03),
    entropic_error_V_per_K=1.0e-4,
    ocv_error_V=0.01,
    longest_relaxation_s=150.0,
)


def size_preset(name: str) -> Preset:
    """The preset of a family around a cell of SHEETS."""
    sheet = SHEETS[name]
    rated_A, ohm = sheet.charge_A, sheet.ohmic_ohm
    heat_W = 2.0 * ohm * rated_A**2
    core_J_per_K = 0.92 * sheet.heat_J_per_K
    cell = CellParameters(
        sheet.capacity_Ah,
        sheet.core_K_per_W,
        core_J_per_K,
        sheet.surface_K_per_W,
        0.08 * sheet.heat_J_per_K,
        2.0 * sheet.heat_J_per_K,
        ohm,
        -5.0e-5,
        OpenCircuitVoltage(*CURVES[sheet.curve], 2.0),
        branches=(Branch(0.5 * ohm, 15.0), Branch(0.5 * ohm, 100.0)),
        interval=INTERVAL,
    )
    return Preset(
        name, "Of a data sheet", ("tests",), cell,
        Limits(
            sheet.max_voltage_V, 1.0, LIMIT_K, LIMIT_K, -rated_A,
            min(sheet.capacity_Ah, 0.5 * rated_A), COMPLETION,
        ),
        Gains(
            0.05, 0.05, 0.6, 3.0 / (sheet.core_K_per_W * core_J_per_K), "worst-case"
        ),
        Uncertainty(0.0, 5e-4, 5e-4, 5e-4, 0.1),
        Timing(0.1, 0.1),
        Sensors(
            Sensor(2e-4 * rated_A, 2e-4 * rated_A, 5e-4 * rated_A),
            Sensor(0.0005, 0.0005, 0.001),
            Sensor(0.01, 0.005, 0.05),
            Sensor(0.01, 0.005, 0.05),
            Sensor(0.005, 0.002, 0.01),
        ),
        Initial(0.1, 298.15, 0.5 * heat_W),
        OperatingBox(
            (-1.09 * rated_A, 0.02 * rated_A),
            (-0.05 * heat_W - 0.02, min(2.0 * heat_W, LARGEST_COOLING_W)),
            (COLDEST_K - 0.5, LIMIT_K + 3.0),
            (COLDEST_K - 10.0, LIMIT_K + 3.0),
        ),
        PlugIn(0.05, 10.0, 15.0, 0.2 * ohm * sheet.capacity_Ah),
        Supply(0.05, 1.0),
        CurrentMap(
            (COLDEST_K, COLDEST_K + 10.0, COLDEST_K + 20.0),
            (0.0, 1.0),
            tuple((share * rated_A,) * 2 for share in (0.1, 0.4, 1.0)),
        ),
    )  # fmt: skip
