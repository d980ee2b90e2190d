"""docs/can.md says of every message, signal and fault what database and firmware say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cantools.autosar
import pytest

from bms.firmware._firmware import ffi, lib
from codegen.can_database import data_ids, load_database, number_attribute
from codegen.can_document import can_document

DATABASE = load_database()
MESSAGES = DATABASE.messages
DOCUMENT = "\n" + can_document(Path(__file__).parents[2] / "firmware_c")


def table(heading: str) -> dict[str, list[str]]:
    """Cells of the rows of a section's table, by their first cell."""
    section = DOCUMENT.split(f"\n{heading}\n")[1].split("\n#")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line[:2] == "| "]
    return {row[0]: row for row in rows[1:]}


@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: m.name)
def test_overview_has_the_facts_of_every_message(message: Any) -> None:
    row = table("# The CAN bus")[f"0x{message.frame_id:03X}"]
    cycle_ms = number_attribute(DATABASE, message, "GenMsgCycleTime")
    timeout_ms = number_attribute(DATABASE, message, "MessageTimeoutTime")
    assert row[1] == f"[{message.name}](#{message.name.lower()})"
    assert row[2].startswith(message.senders[0].replace("PLANT", "plant"))
    assert row[3:5] == [str(message.length), str(cycle_ms)]
    assert (str(timeout_ms) in row[5:]) == (timeout_ms > 0)
    assert ("profile 2" in row) == bool(data_ids(message))


@pytest.mark.parametrize("message", [m for m in MESSAGES if m.signals], ids=lambda m: m.name)
def test_every_signal_has_its_range_resolution_unit_and_pattern(message: Any) -> None:
    rows = table(f"### {message.name}")
    assert set(rows) == {signal.name for signal in message.signals}
    for signal in message.signals:
        _, bits, limits, resolution, *rest = rows[signal.name]
        assert bits == f"{signal.start}…{signal.start + signal.length - 1}"
        assert [float(x) for x in limits.split(" … ")] == [signal.minimum, signal.maximum]
        assert float(resolution) == signal.scale
        if signal.unit:
            assert rest[0].strip() == signal.unit
            assert int(rest[1].strip(" |"), 16) == 2**signal.length - 1
        for value, name in (signal.choices or {}).items():
            assert f"{value} = {name}" in rest[-1]


def test_every_fault_has_its_policy_and_a_meaning() -> None:
    rows, policies = table("## Fault bits"), lib.host_fault_policies()
    assert list(rows) == [str(fault) for fault in range(lib.FAULT_COUNT)]
    for number, symbol in ffi.typeof("fault_t").elements.items():
        _, name, meaning, at_once, periods, *returns = rows[str(number)]
        assert name.upper().replace(" ", "_") == symbol.removeprefix("FAULT_")
        assert meaning
        assert at_once == ("yes" if policies[number].stops_at_once else "no")
        assert int(periods) == policies[number].debounce_periods
        assert int(returns[0] if returns else 0) == policies[number].returns


def test_the_document_names_the_version_of_the_database() -> None:
    version = int(DATABASE.version or 0)
    assert 1 <= version <= 255, "it has 8 bits in Identity"
    assert f"\nVersion {version} of the database" in DOCUMENT


def test_optional_messages_and_those_of_the_boot_stage_are_told() -> None:
    directions = {row[1]: row[2] for row in table("# The CAN bus").values()}
    assert directions["[ChargeMode](#chargemode)"] == "plant to ECU, optional"
    assert directions["[BootRefusal](#bootrefusal)"] == "ECU to plant, boot stage only"
    assert directions["[Plan](#plan)"] == "ECU to plant, where asked for"
    assert sum("," in direction for direction in directions.values()) == 3


def test_a_crc_made_by_the_document_alone_is_that_of_the_example_and_of_cantools() -> None:
    text = DOCUMENT.replace("\n", " ")
    number = r"0x([0-9A-F]+)"
    match = re.search(
        rf"polynomial {number}, start value {number} and final exclusive or {number},", text
    )
    assert match
    width, (polynomial, start, final) = 8, (int(digits, 16) for digits in match.groups())

    def crc(data: bytes) -> int:
        remainder = start
        for byte in data:
            remainder ^= byte
            for _ in range(width):
                remainder = remainder << 1 ^ (polynomial if remainder & 0x80 else 0)
                remainder &= 0xFF
        return remainder ^ final

    example = re.search(rf"A (\w+) of 0 A .* counter (\d+), .* {number}, is `([0-9a-f ]+)`", text)
    assert example
    name, counter, data_id, data = example.groups()
    payload = bytes.fromhex(data)
    message = DATABASE.get_message_by_name(name)
    assert payload[0] == crc(payload[1:] + bytes([int(data_id, 16)]))
    assert data_ids(message)[int(counter)] == int(data_id, 16)
    values = message.decode(payload, decode_choices=False)
    assert values["CommandCurrent"] == 0.0 and values[f"{name}Counter"] == int(counter)
    assert cantools.autosar.check_profile2_crc(payload, int(data_id, 16))


@pytest.mark.parametrize("message", [m for m in MESSAGES if data_ids(m)], ids=lambda m: m.name)
def test_limits_of_the_supervision_can_be_met_and_kept(message: Any) -> None:
    def number(name: str) -> int:
        return number_attribute(DATABASE, message, name)

    window = number("E2EWindowSize")
    assert window <= lib.E2E_LONGEST_WINDOW
    assert number("E2EMaxDeltaCounter") < lib.E2E_COUNTERS // 2
    # Else a message would become valid and lose it again at once.
    assert number("E2EMinOkStateValid") <= number("E2EMinOkStateInit") <= window
    assert number("E2EMinOkStateValid") <= number("E2EMinOkStateInvalid") <= window
    assert number("E2EMaxErrorStateInit") <= number("E2EMaxErrorStateValid") < window
    assert number("E2EMaxErrorStateInvalid") <= number("E2EMaxErrorStateValid")


def test_every_cycle_is_a_whole_number_of_control_periods() -> None:
    period_ms = number_attribute(DATABASE, DATABASE.get_message_by_name("SYNC"), "GenMsgCycleTime")
    for message in MESSAGES:
        cycle_ms = number_attribute(DATABASE, message, "GenMsgCycleTime")
        assert cycle_ms >= period_ms and cycle_ms % period_ms == 0, message.name
