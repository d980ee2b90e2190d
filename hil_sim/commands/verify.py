"""`bms verify`: a machine-checked argument for one cell, or for a pack of cells that differ."""

from __future__ import annotations

from bms.commands.options import JsonOption, ModelOption, PresetOption
from bms.commands.verify import BoxesOption, FormulasOption, SlipsOption
from bms.commands.verify import verify as verify_cell
from bms.presets import DEFAULT_PRESET
from bms.verification import LARGEST_BOXES, Formulas
from hil_sim.commands import pack_options
from hil_sim.pack.spread_kind import SpreadKind
from hil_sim.studies.pack.spread import Surroundings


def verify(
    preset: PresetOption = DEFAULT_PRESET,
    model: ModelOption = None,
    formulas: FormulasOption = Formulas.CORRECTED,
    slips: SlipsOption = False,
    boxes: BoxesOption = LARGEST_BOXES,
    as_json: JsonOption = False,
    cells: pack_options.CellsOption = None,
    spread: pack_options.SpreadOption = SpreadKind.PUBLISHED,
    per_thermistor: pack_options.PerThermistorOption = 1,
    thermistors: pack_options.ThermistorsOption = None,
    neighbour_W_per_K: pack_options.NeighbourOption = Surroundings.neighbour_W_per_K,
    flow_W_per_K: pack_options.FlowOption = Surroundings.flow_W_per_K,
) -> int:
    """Certify that no decision lets a limit be crossed before the next decision acts.

    Branch and bound in interval arithmetic over all states (K), currents (A) and cooling (W), with
    all disturbances, reading errors and estimation errors at their bounds. With --cells every cell
    of a pack: all corners of the spread and cells inside of it, heat from neighbours a disturbance.
    Exit code 1 when something cannot be certified, with the reason, the state and what to change; a
    counter-example is a state that fails in simulation.

    Example: bms verify --cells 16 --json
    """
    around = Surroundings(neighbour_W_per_K, flow_W_per_K)
    if cells is None:
        pack_options.refuse_pack_options(spread, per_thermistor, thermistors)
        is_around = around != Surroundings()
        pack_options.refuse_without_cells("--neighbour-w-per-k, --flow-w-per-k", is_around)
        return verify_cell(preset, model, formulas, slips, boxes, as_json)
    from hil_sim.commands.pack_certificate import verify_pack  # noqa: PLC0415 (only for a pack)

    pack_options.refuse_options(
        {
            "--formulas": formulas is not Formulas.CORRECTED,
            "--slips": slips,
            "--boxes": boxes != LARGEST_BOXES,
        }
    )
    return verify_pack(preset, model, cells, spread, per_thermistor, thermistors, around, as_json)
