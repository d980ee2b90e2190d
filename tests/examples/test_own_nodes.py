"""A plant and an ECU that are not ours, in a process of their own, charge over a bus with ours."""

from __future__ import annotations

import importlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import can
import pytest

from bms.native_build import ROOT
from bms.presets import DEFAULT_PRESET, preset_path
from hil_sim.bus.database import load_codecs

EXAMPLES = ROOT / "examples"
SECONDS = 300.0
"""After which a process counts as stuck."""
PRINTED_TO_S = 0.5
"""By which a time in whole seconds may be more than the one meant."""
FULL_LINE = re.compile(
    r"(?P<time_s>\d+) s: (?P<state>\w+), Cell\(soc=(?P<soc>\S+), "
    r"temperature_K=(?P<temperature_K>\S+), .*\)"
)


def bus_of_this_process(tens: int) -> str:
    """A multicast group, of those for local use, that no other run uses at the same time."""
    return f"udp_multicast:239.74.{tens + os.getpid() // 250 % 10}.{1 + os.getpid() % 250}"


def started(*command: object) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, *map(str, command)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )


def our(command: str, *arguments: object) -> subprocess.Popen[str]:
    # python-can imports asammdf where it is, which takes seconds here and is not needed.
    program = 'import sys; sys.modules["asammdf"] = None; from bms.cli import main; main()'
    return started("-c", program, command, *arguments)


def finished(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    try:
        printed, error = process.communicate(timeout=SECONDS)
    finally:
        process.kill()
    return process.returncode, printed, error


@pytest.mark.slow
def test_a_cell_of_ones_own_is_charged_by_our_ecu() -> None:
    bus = bus_of_this_process(170)
    ecu = our("ecu", "--bus", bus, "--silence-s", 3)
    code, printed, error = finished(started(EXAMPLES / "own_plant.py", bus))
    ecu_code, ecu_printed, ecu_error = finished(ecu)
    assert (code, error, ecu_code, ecu_error) == (0, "", 0, ""), printed + ecu_printed
    seen = [match.groupdict() for match in map(FULL_LINE.fullmatch, printed.splitlines()) if match]
    assert len(seen) == len(printed.splitlines())
    states = [row["state"] for row in seen]
    assert "Derated" in states
    assert states[-1] == "Complete"
    assert 0.989 < float(seen[-1]["soc"]) < 0.991
    assert max(float(row["temperature_K"]) for row in seen) < 323.0
    (steps,) = re.findall(r"(\d+) steps", ecu_printed)
    assert int(steps) >= (float(seen[-1]["time_s"]) - PRINTED_TO_S) / 0.1


@pytest.mark.slow
def test_an_ecu_of_ones_own_charges_our_plant_within_its_limits(tmp_path: Path) -> None:
    warm = tmp_path / "warm.toml"
    text = preset_path(DEFAULT_PRESET).read_text(encoding="utf-8")
    for initial, later in (("soc = 0.0001", "soc = 0.8"), ("= 282.7", "= 306.0")):
        assert initial in text
        text = text.replace(initial, later)
    warm.write_text(text)
    bus = bus_of_this_process(180)
    ecu = started(EXAMPLES / "own_ecu.py", bus)
    code, printed, error = finished(our("plant", "--bus", bus, "--preset", warm, "--json"))
    assert (code, error) == (0, "")
    assert finished(ecu) == (0, "silence; last state Complete\n", "")
    summary = json.loads(printed)
    assert (summary["stop_reason"], summary["limits_kept"]) == ("complete", True)
    assert (summary["controller"], summary["kan_rmse_K"]) == ("foreign-ecu", None)
    assert 0.99 < summary["final_soc"] <= 1.0
    assert 310.0 < summary["max_surface_temperature_K"] < 320.0, "it was derated"
    assert {*summary["command_reception"].values()} == {0}


@pytest.fixture
def line() -> Iterator[tuple[can.BusABC, can.BusABC]]:
    """Both ends of a bus in this process."""
    channel = "own-nodes"
    with can.Bus(channel, "virtual") as near, can.Bus(channel, "virtual") as far:
        yield near, far


@pytest.fixture
def bus_module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return importlib.import_module("protected_bus")


@pytest.fixture
def controller(bus_module: ModuleType) -> Any:
    controller = importlib.import_module("own_ecu").Controller()
    controller.step(period(Request="Off"))
    return controller


def period(**changes: float | str | None) -> dict[str, dict[str, float | str | None]]:
    messages: dict[str, dict[str, float | str | None]] = {
        "CellElectrical": {"Current": -10.0, "Voltage": 3.3},
        "CellThermal": {"SurfaceTemperature": 300.0, "CoolantTemperature": 298.0},
        "Coolant": {"CoolingPower": 0.3},
        "ChargeRequest": {"Request": "Charge", "ReferenceCurrent": -23.0},
    }
    for values in messages.values():
        values.update({name: changes[name] for name in values if name in changes})
    return messages


def test_what_the_example_sends_our_side_reads_with_every_counter(
    bus_module: ModuleType, line: tuple[can.BusABC, can.BusABC]
) -> None:
    sender, codec = bus_module.ProtectedBus(line[0], "PLANT"), load_codecs()["CellThermal"]
    for counter in range(17):
        sender.send("CellThermal", SurfaceTemperature=310.0, CoolantTemperature=300.0 + counter)
        frame = line[1].recv(1.0)
        assert frame is not None and frame.arbitration_id == codec.frame_id
        assert codec.counter(frame.data) == counter % 16
        values = codec.decode(bytes(frame.data))
        assert values == {"SurfaceTemperature": 310.0, "CoolantTemperature": 300.0 + counter}


def test_what_our_side_sends_the_example_takes_once_and_only_intact(
    bus_module: ModuleType, line: tuple[can.BusABC, can.BusABC]
) -> None:
    receiver, codec = bus_module.ProtectedBus(line[0], "ECU"), load_codecs()["CellElectrical"]
    good = codec.encode({"Current": -5.0, "Voltage": None}, counter=3)
    damaged = codec.encode({"Current": -5.0, "Voltage": 3.3}, counter=4)
    damaged = damaged[:3] + bytes([damaged[3] ^ 1]) + damaged[4:]
    late = codec.encode({"Current": -6.0, "Voltage": 3.3}, counter=4)
    for data in (good, good, damaged, good[:-1], late):
        line[1].send(can.Message(arbitration_id=0x100, data=data, is_extended_id=False))
    line[1].send(can.Message(arbitration_id=0x7FF, data=b"foreign", is_extended_id=False))
    heard = [receiver.receive(0.0) for _ in range(3)]
    assert [(name, values["Current"], values["Voltage"]) for name, values in heard[:2]] == [
        ("CellElectrical", -5.0, None),
        ("CellElectrical", -6.0, pytest.approx(3.3)),
    ]
    assert heard[2] is None


@pytest.mark.parametrize(
    ("changes", "allowed_A", "state"),
    [
        ({}, -23.0, "Charging"),
        ({"SurfaceTemperature": 310.0}, -23.0, "Charging"),
        ({"SurfaceTemperature": 315.0}, -11.5, "Derated"),
        ({"SurfaceTemperature": 320.0}, 0.0, "Derated"),
        ({"Voltage": 3.5}, -10.0, "Derated"),
        ({"Voltage": 3.5, "Current": -1.0}, 0.0, "Complete"),
        ({"Voltage": None}, 0.0, "Standby"),
        ({"Request": "NotAvailable"}, 0.0, "Standby"),
    ],
)
def test_the_controller_of_the_example_takes_the_weakest_of_its_limits(
    controller: Any, changes: dict[str, float | str | None], allowed_A: float, state: str
) -> None:
    assert controller.step(period(**changes)) == pytest.approx(allowed_A)
    assert controller.state == state


@pytest.mark.parametrize("missing", ["CellElectrical", "CellThermal", "Coolant", "ChargeRequest"])
def test_the_controller_of_the_example_needs_every_message_in_every_period(
    controller: Any, missing: str
) -> None:
    assert controller.step(period()) < 0.0
    messages = period()
    del messages[missing]
    assert controller.step(messages) == 0.0
