"""What bms.firmware says of the C code to others, and that it alone knows the extension."""

import re
from pathlib import Path

import numpy as np
import pytest

from bms.errors import InputError
from bms.firmware._firmware import ffi
from bms.firmware.batches import ChargeBatch, DecisionBatch, EstimateBatch
from bms.firmware.calibration import calibration_bytes, calibration_hashes, used_bytes
from bms.firmware.controller import Firmware
from bms.firmware.image_checks import ImagePart, calibration_status
from bms.firmware.image_header import HEADER_LENGTH
from bms.kan.network import INPUT_NAMES
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET

ROOT = Path(__file__).parents[2]
INPUTS = np.array([[-20.0, 0.5, 300.0, 295.0], [-5.0, 0.2, 310.0, 305.0], [0.0, 0.0, 320.0, 318.0]])


@pytest.fixture(scope="module")
def pair():
    return load_pair(DEFAULT_PRESET, None)


def test_only_the_firmware_package_imports_its_extension():
    users = {
        path.parent.relative_to(ROOT).as_posix()
        for wing in ("bms", "codegen", "hil_sim")
        for path in (ROOT / wing).rglob("*.py")
        if re.search(r"^\s*(from|import) bms\.firmware\._firmware\b", path.read_text(), re.M)
    }
    assert users == {"bms/firmware"}


def test_a_batch_of_estimates_is_the_estimates_one_by_one(pair):
    firmware = Firmware(*pair)
    single_K = [
        firmware.estimate(**dict(zip(INPUT_NAMES, row))).core_temperature_K
        for row in INPUTS.tolist()
    ]
    assert EstimateBatch(*pair, INPUTS).run().tolist() == single_K


def test_a_batch_of_decisions_is_the_decisions_one_by_one(pair):
    states = [
        {
            "soc": 0.5,
            "core_temperature_K": surface_K + 1.0,
            "surface_temperature_K": surface_K,
            "coolant_temperature_K": coolant_K,
            "cooling_power_W": cooling_W,
            "reference_current_A": -23.0,
        }
        for _, cooling_W, surface_K, coolant_K in INPUTS.tolist()
    ]
    firmware = Firmware(*pair)
    single_A = [firmware.solve(**state).current_A for state in states]
    assert len(set(single_A)) > 1
    assert DecisionBatch(*pair, states).run().tolist() == single_A


@pytest.mark.parametrize("frames", [[], [[(0x080, b"")], []]])
def test_a_batch_of_periods_needs_equally_many_frames_in_each(pair, frames):
    with pytest.raises(ValueError, match="same number of frames"):
        ChargeBatch(*pair, frames)


def test_hashes_of_a_calibration_are_those_of_model_and_preset(pair):
    preset, model = pair
    content = calibration_bytes(preset, model)
    assert calibration_hashes(content) == (int(model.hash[:8], 16), int(preset.hash[:8], 16))
    assert calibration_hashes(content + b"behind") == calibration_hashes(content)
    assert calibration_hashes(content[:12]) == calibration_hashes(content)
    with pytest.raises(ValueError, match="12 bytes of a block"):
        calibration_hashes(content[:11])


def test_a_block_is_cut_behind_the_tables_and_only_a_whole_one(pair):
    content = calibration_bytes(*pair)
    whole = content.ljust(ffi.sizeof("bms_calibration_t"), b"\x55")
    assert used_bytes(whole) == content
    with pytest.raises(ValueError, match="calibration block"):
        used_bytes(whole[:-1])
    kan = ffi.offsetof("bms_calibration_t", "kan")
    with pytest.raises(ValueError, match="exceeds the maxima"):
        used_bytes(whole[:kan] + bytes([4]) + whole[kan + 1 :])  # layers


def test_a_calibration_is_checked_against_a_whole_header_only():
    part = ImagePart(bytes(100), 0)
    assert calibration_status(part, bytes(HEADER_LENGTH)) == "IMAGE_NO_MAGIC"
    with pytest.raises(ValueError, match=f"{HEADER_LENGTH} bytes"):
        calibration_status(part, bytes(HEADER_LENGTH - 1))


def test_one_state_does_not_decide_for_a_family():
    with pytest.raises(InputError, match="one state does not decide for a family of cells"):
        Firmware("a123_26650").solve(
            soc=0.5,
            core_temperature_K=300.0,
            surface_temperature_K=300.0,
            coolant_temperature_K=300.0,
            cooling_power_W=1.0,
            reference_current_A=-10.0,
        )
