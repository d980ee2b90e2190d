"""What the page fetches beside its own files, as JSON: presets, database, rows of the fault matrix.

A server makes it on demand, `hil_sim.dashboard.site` as files.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from bms.calibration.plausibility import plausibility_fields
from bms.model.model_file import KanModel
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET, Preset, load_preset, preset_names
from codegen import can_database
from hil_sim.bus.catalog import FirstFault
from hil_sim.bus.database import load_codecs
from hil_sim.dashboard.limits import tightened
from hil_sim.dashboard.scenario import scenario_bytes
from hil_sim.fault_matrix.matrix import Row, fault_numbers, load_matrix
from hil_sim.fault_matrix.place import nominal_initial, nominal_onset
from hil_sim.fault_matrix.size import sized

_NOT_OF_A_FAULT = ("from_s", "from_period")
_LIMITS = {
    "core_K": "max_core_temperature_K",
    "surface_K": "max_surface_temperature_K",
    "voltage_V": "max_voltage_V",
    "soc": "max_soc",
    "completion_soc": "completion_soc",
    "reference_A": "reference_current_A",
}


def config_data(
    bus: str | None,
    chosen: str = DEFAULT_PRESET,
    limits: Mapping[str, Mapping[str, Sequence[str]]] | None = None,
) -> dict[str, Any]:
    """What there is to show: a bus or none, and the presets, the chosen one first.

    `limits` are the values by preset and limit, one limit at a time, of which there are files;
    None where a server makes the calibration of any.
    """
    others = [name for name in preset_names() if name != chosen]
    return {
        "bus": bus,
        "presets": [chosen, *others],
        "packs": DEFAULT_PRESET,
        "limits": limits,
    }


@cache
def database_data() -> dict[str, Any]:
    """The CAN database as the page decodes by it."""
    codecs = load_codecs()
    cycles_s = {
        m.name: 1e-3 * can_database.number_attribute(parsed, m, can_database.CYCLE_ATTRIBUTE)
        for parsed in (can_database.load_database(),)
        for m in parsed.messages
    }
    return {
        "messages": [
            {
                "name": codec.name,
                "id": codec.frame_id,
                "length": codec.length,
                "data_ids": list(codec.data_ids),
                "cycle_s": cycles_s[codec.name],
                "signals": [asdict(signal) for signal in codec.signals],
            }
            for codec in codecs.values()
        ],
        "choices": {
            signal: {str(value): name for value, name in names.items()}
            for codec in codecs.values()
            for signal, names in codec.choices.items()
        },
        "faults": _fault_names(),
    }


def preset_data(name: str, model_path: Path | None = None) -> dict[str, Any]:
    """A preset, by name or path, with its model for the plant and the controls.

    Raises InputError or ModelMismatchError as load_pair.
    """
    return _preset_data(*load_pair(name, model_path))


def tightened_data(name: str, model_path: Path | None, wanted: Mapping[str, str]) -> dict[str, Any]:
    """A preset with lower limits as preset_data, with its file and its rows of the fault matrix.

    Raises InputError as `tightened`, and as load_pair.
    """
    _, own = load_pair(name, model_path)
    preset, text = tightened(name, wanted)
    return {
        "preset": _preset_data(*load_pair(preset, own)),
        "rows": _rows_data(preset),
        "file": text,
    }


def _preset_data(preset: Preset, model: KanModel) -> dict[str, Any]:
    box = preset.operating_box
    coldest_K, hottest_K = box.surface_temperature_K
    low_W, high_W = box.cooling_power_W
    return {
        "name": preset.name,
        "description": preset.description,
        "preset_hash": preset.hash,
        "model_hash": model.hash,
        "scenario": base64.b64encode(scenario_bytes(preset, model)).decode(),
        "period_s": preset.timing.sampling_period_s,
        "limits": limits_data(preset),
        "initial": asdict(preset.initial),
        "temperature_K": {"low": coldest_K, "high": hottest_K},
        "cooling_power_W": {"low": low_W, "high": high_W},
        "is_family": preset.cell.interval is not None,
        "permitted_A": float(plausibility_fields(preset)["current_deviation_A"]),
        "growth_A": preset.limits.current_growth_A_per_s * preset.timing.sampling_period_s,
    }


def limits_data(preset: Preset) -> dict[str, float]:
    """The limits by the names of the page."""
    return {name: getattr(preset.limits, of) for name, of in _LIMITS.items()}


def rows_data(name: str) -> list[dict[str, Any]]:
    """The rows of the fault matrix that need no wall clock, with their starts for a preset.

    Raises InputError as load_preset.
    """
    return _rows_data(load_preset(name))


def _rows_data(preset: Preset) -> list[dict[str, Any]]:
    return [_row_data(row, preset) for row in load_matrix() if not row.realtime]


def _row_data(row: Row, preset: Preset) -> dict[str, Any]:
    fault = asdict(sized(row.fault, row.size, preset))
    return {
        "name": row.name,
        "group": row.name.partition(":")[0],
        "fault": {
            key: value
            for key, value in fault.items()
            if value is not None and key not in _NOT_OF_A_FAULT
        },
        "expect": asdict(row.expect),
        "after_periods": row.start.after_periods,
        "needs": list(row.needs),
        "note": row.note,
        "start": {
            **asdict(nominal_initial(preset, row.start)),
            "onset": nominal_onset(preset, row.start),
        },
    }


def _fault_names() -> Sequence[str]:
    names = {number: name for name, number in fault_numbers().items()}
    return [names.get(n, FirstFault.NONE.label) for n in range(max(names) + 1)]
