"""Another cell of a family: the nominal one with its parameters scaled."""

from __future__ import annotations

from dataclasses import dataclass, replace

from bms.cell.parameters import CellParameters
from bms.validation import Finite, NonNegative, Positive, strict


@strict
@dataclass(frozen=True)
class CellFactors:
    """Factors on the nominal parameters, and additions to dU/dT and the open-circuit voltage.

    `resistance` scales the ohmic resistance, constant and table, `polarisation` the resistances of
    the branches (0: there are none), `relaxation` their time constants; the others are named as in
    CellInterval.
    """

    core_resistance: Positive = 1.0
    core_heat_capacity: Positive = 1.0
    surface_resistance: Positive = 1.0
    surface_heat_capacity: Positive = 1.0
    coolant_heat_capacity: Positive = 1.0
    resistance: Positive = 1.0
    polarisation: NonNegative = 1.0
    relaxation: Positive = 1.0
    capacity: Positive = 1.0
    entropic_error_V_per_K: Finite = 0.0
    ocv_error_V: Finite = 0.0


def scaled(cell: CellParameters, factors: CellFactors) -> CellParameters:
    """The cell with its parameters scaled; its interval, which is of the nominal one, is left out.

    Raises InputError when a parameter leaves the floats that are positive.
    """
    table, entropy, ocv = cell.resistance, cell.entropy, cell.ocv
    if table is not None:
        rows = (tuple(factors.resistance * ohm for ohm in row) for row in table.ohm)
        table = replace(table, ohm=tuple(rows))
    if entropy is not None:
        added = (factors.entropic_error_V_per_K + value for value in entropy.V_per_K)
        entropy = replace(entropy, V_per_K=tuple(added))
    return replace(
        cell,
        capacity_Ah=cell.capacity_Ah * factors.capacity,
        core_resistance_K_per_W=cell.core_resistance_K_per_W * factors.core_resistance,
        core_heat_capacity_J_per_K=cell.core_heat_capacity_J_per_K * factors.core_heat_capacity,
        surface_resistance_K_per_W=cell.surface_resistance_K_per_W * factors.surface_resistance,
        surface_heat_capacity_J_per_K=cell.surface_heat_capacity_J_per_K
        * factors.surface_heat_capacity,
        coolant_heat_capacity_J_per_K=cell.coolant_heat_capacity_J_per_K
        * factors.coolant_heat_capacity,
        ohmic_resistance_ohm=cell.ohmic_resistance_ohm * factors.resistance,
        entropic_coefficient_V_per_K=cell.entropic_coefficient_V_per_K
        + factors.entropic_error_V_per_K,
        ocv=replace(ocv, voltage_V=tuple(v + factors.ocv_error_V for v in ocv.voltage_V)),
        resistance=table,
        entropy=entropy,
        branches=()
        if factors.polarisation == 0.0
        else tuple(
            replace(
                branch,
                resistance_ohm=branch.resistance_ohm * factors.polarisation,
                time_constant_s=branch.time_constant_s * factors.relaxation,
            )
            for branch in cell.branches
        ),
        interval=None,
    )
