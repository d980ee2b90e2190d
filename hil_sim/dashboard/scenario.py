"""A preset as the WebAssembly module takes it: the bytes of its session_scenario_t.

The structure has no pointers, and its members lie as they do on a 64-bit host.
"""

from __future__ import annotations

from functools import cache

from cffi import FFI

from bms.firmware.calibration import calibration_bytes
from bms.image import calibration_content
from bms.model.model_file import KanModel
from bms.native_build import ROOT, declarations
from bms.presets import Preset
from hil_sim.bus.catalog import Message
from hil_sim.bus.database import load_codecs
from hil_sim.bus.wire import message_fields, wire_fields
from hil_sim.dashboard.module import HEADERS
from hil_sim.dashboard.ziggurat import ziggurat_tables
from hil_sim.nodes.plant import PUBLISHED
from hil_sim.plant.charger import Charger
from hil_sim.plant.sensors import Readings
from hil_sim.studies.campaign._runner import ffi as runner
from hil_sim.studies.campaign.engine import Scenario
from hil_sim.studies.campaign.settings import CampaignSettings

_COMMAND_SIGNAL = "CommandCurrent"


def scenario_bytes(preset: Preset, model: KanModel) -> bytes:
    """The structure for a preset and its model; InputError as the campaign's Scenario."""
    codecs = load_codecs()
    command = codecs[Message.CHARGE_COMMAND]
    campaign = Scenario(CampaignSettings(preset, model, runs=1))
    block = calibration_bytes(preset, model)
    ffi = _layout()
    scenario = ffi.new(
        "session_scenario_t *",
        {
            "published": wire_fields([codecs[name] for name in PUBLISHED]),
            "command": message_fields(command),
            "normals": ziggurat_tables(),
            "bias": [getattr(preset.sensors, name).bias for name in Readings._fields],
            "calibration_content": calibration_content(preset, model),
            "command_current": command.signal_names.index(_COMMAND_SIGNAL),
            "silent_periods_to_stop": Charger(preset).silent_periods_to_stop,
        },
    )
    ffi.buffer(ffi.addressof(scenario, "charge"))[:] = runner.buffer(campaign.fields)
    ffi.buffer(ffi.addressof(scenario, "calibration"))[: len(block)] = block
    return bytes(ffi.buffer(scenario))


@cache
def _layout() -> FFI:
    layout = FFI()
    layout.cdef("\n".join(declarations(ROOT / header) for header in HEADERS))
    return layout
