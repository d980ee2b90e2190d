"""Options of the whole suite."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest
from _pytest.terminal import TerminalReporter
from hypothesis import settings

from bms.native_build import FIRMWARE
from bms.studies.rivals.native_build import RIVALS
from hil_sim.native.native_build import NATIVE
from hil_sim.studies.campaign.native_build import RUNNER
from hil_sim.studies.pack.native_build import PACK
from tools.long_checks import load_checks

# The machine may be busy with other tests; time is measured in benchmarks only.
settings.register_profile("no_deadline", deadline=None)
settings.load_profile("no_deadline")

Command = Callable[..., tuple[int, str, str]]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--firmware-build",
        type=Path,
        help="folder of a variant made by 'python -m bms.native_build', used instead",
    )
    parser.addoption(
        "--pack-build", type=Path, help="folder of a variant of the packs' extension, used instead"
    )
    parser.addoption("--long", metavar="GROUP", help="the long tests of this group and no others")


def pytest_configure(config: pytest.Config) -> None:
    """Put variants in the place of installed extensions; refuse extensions of other sources."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # As a shell does for what it starts in the background; all children would inherit it.
        signal.signal(signal.SIGINT, signal.default_int_handler)
    for extension, option in (
        *((FIRMWARE, "--firmware-build"), (PACK, "--pack-build")),
        *((RIVALS, None), (NATIVE, None), (RUNNER, None)),
    ):
        folder = None if option is None else config.getoption(option)
        if folder is not None:
            extension.load_build(folder)
            continue
        if extension.is_stale(import_module(extension.module)):
            raise pytest.UsageError(
                f"{extension.module} was built from other C sources than lie here now; "
                "run 'make build'"
            )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Long tests run when they are asked for; results/ has what they said last."""
    wanted = config.getoption("--long")
    config.hook.pytest_deselected(items=[item for item in items if _group(item) != wanted])
    items[:] = [item for item in items if _group(item) == wanted]


def _group(item: pytest.Item) -> str | None:
    marker = item.get_closest_marker("long")
    return None if marker is None else str(marker.args[0])


def pytest_terminal_summary(terminalreporter: TerminalReporter, config: pytest.Config) -> None:
    """Say what kept results hold instead; tests/test_long_checks.py holds those to date."""
    groups = [check.name for check in load_checks() if check.name.startswith("long-")]
    if config.getoption("--long") is None:
        terminalreporter.line(
            f"long tests are left to {', '.join(groups)} in results/; 'make long-checks' runs them"
        )


@pytest.fixture
def bms(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Calls the command line; gives exit code, stdout and stderr."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["bms", *map(str, arguments)])
        monkeypatch.setattr("bms.waiting.FIRST_LINE_S", 1e9)  # a busy machine makes anything long
        with pytest.raises(SystemExit) as stop:
            import_module("bms.cli").main()
        captured = capsys.readouterr()
        return int(stop.value.code or 0), captured.out, captured.err

    return call


def pytest_report_header() -> str:
    import_module("bms.firmware")
    return f"firmware: {sys.modules[FIRMWARE.module].__file__}"
