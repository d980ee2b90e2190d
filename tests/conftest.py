"""Options of the whole suite."""

from pathlib import Path

import pytest

import bms.firmware


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--firmware-build",
        type=Path,
        help="folder of a variant made by 'python -m bms.firmware.build', used instead",
    )


def pytest_configure(config: pytest.Config) -> None:
    folder = config.getoption("--firmware-build")
    if folder is not None:
        bms.firmware.__path__.insert(0, str(folder.resolve() / "bms" / "firmware"))
