"""A charge with both units, the ECU's and the plant's, driven by FMPy as an importer does.

    bms export --fmu ecu --fmu plant --out out/fmu
    python examples/co_simulation.py out/fmu/ecu.fmu out/fmu/plant_fmi3.fmu out/fmu/can.log

Sensors, charger and the plant's end of the bus are those of `bms sil`, so that the recorded frames
are the same. How an importer handles the ECU's clocks is in hil_sim/fmu/driven_ecu.py.
"""

from __future__ import annotations

import sys
from pathlib import Path

from bms.presets import load_preset
from hil_sim.fmu.driven_ecu import DrivenEcu
from hil_sim.logs.recorder import Recorder
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings

PRESET = "paper_calibrated"


def charge(ecu: Path, plant: Path, log: Path) -> str:
    """Charge to the end and record the bus; why it ended."""
    preset = load_preset(PRESET)
    settings = Settings(preset=preset, plant=f"fmu:{plant}")
    period_s = preset.timing.sampling_period_s
    with Recorder(log) as recorder:
        result = run_both(
            settings, recorder, ecu_factory=lambda plant, database: DrivenEcu(ecu, period_s)
        )
    summary = result.summary
    print(f"{summary.stop_reason} after {summary.charge_time_s} s in {summary.steps} periods")
    return summary.stop_reason


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    sys.exit(charge(*map(Path, sys.argv[1:])) != "complete")
