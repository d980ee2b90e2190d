"""Which constants the firmware runs with: those of the preset it is given, whatever its name."""

from __future__ import annotations

from pathlib import Path

import pytest

from bms.errors import ModelMismatchError
from bms.firmware import Firmware
from bms.firmware._firmware import lib
from bms.firmware.calibration import calibration_block
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET, preset_path

NEAR_THE_CORE_LIMIT = {
    "soc": 0.5,
    "core_temperature_K": 316.0,
    "surface_temperature_K": 313.0,
    "coolant_temperature_K": 308.0,
    "cooling_power_W": 0.5,
    "reference_current_A": -23.0,
}


def test_the_default_preset_uses_the_compiled_in_block() -> None:
    block = calibration_block(*load_pair(DEFAULT_PRESET, None), compiled_in=True)
    assert block == lib.host_default_calibration()


def test_a_changed_copy_of_the_default_preset_has_constants_of_its_own(tmp_path: Path) -> None:
    text = preset_path(DEFAULT_PRESET).read_text(encoding="utf-8")
    line = "max_core_temperature_K = 323.0"
    assert line in text
    copy = tmp_path / "mine.toml"
    copy.write_text(text.replace(line, "max_core_temperature_K = 320.0"), encoding="utf-8")

    default = Firmware(DEFAULT_PRESET).solve(**NEAR_THE_CORE_LIMIT)
    cooler = Firmware(copy).solve(**NEAR_THE_CORE_LIMIT)

    assert default.feasible and cooler.feasible
    assert cooler.active_constraint == "core"
    assert cooler.current_A > default.current_A + 1.0


def test_tables_that_are_not_those_of_the_shipped_preset_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    preset, model = load_pair(DEFAULT_PRESET, None)
    stale = calibration_block(*load_pair("lin2014", None), compiled_in=False)

    class StaleLibrary:
        def __getattr__(self, name: str) -> object:
            return (lambda: stale) if name == "host_default_calibration" else getattr(lib, name)

    monkeypatch.setattr("bms.firmware.calibration.lib", StaleLibrary())
    with pytest.raises(ModelMismatchError, match="make generate"):
        calibration_block(preset, model, compiled_in=True)
