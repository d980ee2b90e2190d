"""What no calibration exceeds: numbers of the firmware, not of the calibration that they judge."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib
from bms.presets import preset_names

ENVELOPE: dict[str, tuple[float, float]] = {
    "sampling_period_s": (0.001, 10.0),
    "reference_current_A": (-3000.0, -0.001),
    "current_growth_A": (1e-6, 3000.0),
    "completion_soc": (0.01, 1.0),
    "rcbf.max_core_temperature_K.high_K": (253.0, 353.0),
    "rcbf.max_surface_temperature_K.high_K": (253.0, 353.0),
    "rcbf.capacity_As": (0.5 * 3600.0, 300.0 * 3600.0),
    "rcbf.max_voltage_V": (1.5, 4.5),
    "rcbf.max_soc": (0.01, 1.0),
    "rcbf.estimation_error_bound_K": (0.0, 30.0),
    "plausibility.current_A.low": (-6000.0, 0.0),
    "plausibility.current_A.high": (0.0, 6000.0),
    "plausibility.surface_temperature_K.high": (253.0, 423.0),
    "plausibility.coolant_temperature_K.high": (253.0, 423.0),
    "plausibility.current_deviation_A": (1e-6, 300.0),
    "plausibility.voltage_deviation_V": (1e-6, 1.0),
    "plausibility.voltage_overshoot_V": (1e-6, 0.3),
    "plausibility.temperature_overshoot_K": (1e-6, 10.0),
    "plausibility.surface_deficit_K": (1e-6, 30.0),
    "plausibility.reading_error.0": (0.0, 100.0),
    "plausibility.reading_error.3": (0.0, 100.0),
    "rcbf.ocv_V.0": (0.0, float("nan")),
    "rcbf.ocv_V.-1": (float("nan"), 4.6),
}


def put(block: Any, path: str, value: float) -> None:
    *parts, last = path.split(".")
    part = block
    for name in parts:
        part = getattr(part, name)
    if last.lstrip("-").isdigit():
        part[int(last) % block.rcbf.ocv_points if "ocv" in path else int(last)] = value
    else:
        setattr(part, last, value)


def accepts(path: str, value: float) -> bool:
    """Whether the default calibration is still valid with another number in one place."""
    block = ffi.new("bms_calibration_t *", lib.host_default_calibration()[0])
    put(block, path, value)
    return bool(lib.calibration_is_valid(block))


@pytest.mark.parametrize(("path", "bounds"), ENVELOPE.items(), ids=list(ENVELOPE))
def test_a_calibration_is_taken_up_to_the_envelope_and_not_beyond(
    path: str, bounds: tuple[float, float]
) -> None:
    for bound, beyond in zip(bounds, (-np.inf, np.inf)):
        if not np.isnan(bound):
            at = np.float32(bound)
            assert accepts(path, float(at)), f"{path} = {at}"
            assert not accepts(path, float(np.nextafter(at, np.float32(beyond))))
            assert not accepts(path, beyond)
    assert not accepts(path, float("nan"))


@pytest.mark.parametrize("path", ENVELOPE)
@pytest.mark.parametrize("value", [1e30, -1e30, 449.0 * 14.0])
def test_absurd_numbers_are_refused_everywhere(path: str, value: float) -> None:
    if not ENVELOPE[path][0] <= value <= ENVELOPE[path][1]:
        assert not accepts(path, value)


@pytest.mark.parametrize("name", preset_names())
def test_every_shipped_preset_is_inside(name: str) -> None:
    assert lib.calibration_is_valid(Ecu(name)._calibration)
