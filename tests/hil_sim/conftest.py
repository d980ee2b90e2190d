"""What several files of tests need."""

import pytest

from bms.presets import Preset, load_preset, one_cell_preset_names
from hil_sim.bus.database import MessageCodec, load_codecs


@pytest.fixture(scope="session")
def preset() -> Preset:
    return load_preset("paper_calibrated")


@pytest.fixture(params=one_cell_preset_names(), scope="session")
def any_preset(request: pytest.FixtureRequest) -> Preset:
    return load_preset(request.param)


@pytest.fixture(scope="session")
def database() -> dict[str, MessageCodec]:
    return load_codecs()
