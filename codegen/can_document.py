"""docs/can.md: the CAN database for people, with the faults that the firmware reports on it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cantools import autosar
from cantools.database.can import Database, Message, Signal

from codegen.can_database import (
    BOOT_STAGE_ATTRIBUTE,
    CYCLE_ATTRIBUTE,
    ECU,
    OPTIONAL_ATTRIBUTE,
    TIMEOUT_ATTRIBUTE,
    data_ids,
    load_database,
    network_version,
    number_attribute,
)
from codegen.rendering import environment

_EXAMPLE = "ChargeCommand"
_LIMITS = (
    "E2EMaxDeltaCounter",
    "E2EWindowSize",
    *("E2EMinOkStateInit", "E2EMaxErrorStateInit"),
    *("E2EMinOkStateValid", "E2EMaxErrorStateValid"),
    *("E2EMinOkStateInvalid", "E2EMaxErrorStateInvalid"),
)


def can_document(firmware: Path) -> str:
    """Text of docs/can.md from the database, and the faults and CRC of the sources in a folder."""
    database = load_database()
    messages = sorted(database.messages, key=lambda message: message.frame_id)
    return (
        environment()
        .get_template("can.md.j2")
        .render(
            version=network_version(database),
            messages=[described_message(database, message) for message in messages],
            crc=_crc(firmware),
            example=_example(database),
            limit_names=[name.removeprefix("E2E") for name in _LIMITS],
            faults=list(_faults(firmware)),
        )
    )


def described_message(database: Database, message: Message) -> dict[str, Any]:
    """What a document says of a message."""
    timeout_ms = number_attribute(database, message, TIMEOUT_ATTRIBUTE)
    return {
        "name": message.name,
        "id": message.frame_id,
        "length": message.length,
        "direction": _direction(database, message),
        "cycle_ms": number_attribute(database, message, CYCLE_ATTRIBUTE),
        "timeout_ms": timeout_ms,
        "is_protected": bool(data_ids(message)),
        "is_supervised": timeout_ms > 0 and bool(data_ids(message)),
        "limits": [number_attribute(database, message, name) for name in _LIMITS],
        "data_ids": data_ids(message).hex(" "),
        "comment": message.comment,
        "signals": [described_signal(signal) for signal in message.signals],
    }


def _direction(database: Database, message: Message) -> str:
    if message.senders != [ECU]:
        is_optional = number_attribute(database, message, OPTIONAL_ATTRIBUTE)
        return "plant to ECU, optional" if is_optional else "plant to ECU"
    if number_attribute(database, message, BOOT_STAGE_ATTRIBUTE):
        return "ECU to plant, boot stage only"
    is_optional = number_attribute(database, message, OPTIONAL_ATTRIBUTE)
    return "ECU to plant, where asked for" if is_optional else "ECU to plant"


def _crc(firmware: Path) -> dict[str, str]:
    """Start value and final exclusive or, by the names that the firmware has for them."""
    source = (firmware / "src" / "e2e.c").read_text(encoding="utf-8")
    return {
        name.lower(): f"0x{int(value, 16):02X}"
        for name, value in re.findall(r"#define CRC8_(START|FINAL_XOR) (0x\w+)u", source)
    }


def _example(database: Database) -> dict[str, str]:
    """A frame that others can try their CRC on."""
    message, counter = database.get_message_by_name(_EXAMPLE), 1
    values = {name: 0 for name in (signal.name for signal in message.signals)}
    values |= {f"{_EXAMPLE}Counter": counter, "CommandState": 1}
    data = message.encode(values, strict=False)
    whole = autosar.apply_profile2_crc(data, data_ids(message)[counter])
    assert whole is not None
    return {
        "name": _EXAMPLE,
        "counter": str(counter),
        "data_id": f"0x{data_ids(message)[counter]:02X}",
        "data": bytes(whole).hex(" "),
    }


def described_signal(signal: Signal) -> dict[str, Any]:
    """What a document says of a signal."""
    choices = {int(value): str(name) for value, name in (signal.choices or {}).items()}
    notes = [", ".join(f"{value} = {name}" for value, name in choices.items())]
    return {
        "name": signal.name,
        "bits": f"{signal.start}…{signal.start + signal.length - 1}",
        "range": f"{_number(signal.minimum)} … {_number(signal.maximum)}",
        "resolution": f"{signal.scale:g}",
        "unit": signal.unit or "",
        "not_available": f"0x{2**signal.length - 1:X}" if signal.unit else "",
        "note": "; ".join(filter(None, [*notes, signal.comment])),
    }


def _number(value: float | None) -> str:
    assert value is not None, "every signal of the database has its range"
    return str(int(value)) if value == int(value) else f"{value:.10g}"


def _faults(firmware: Path) -> Iterator[dict[str, Any]]:
    header = (firmware / "include" / "monitor.h").read_text(encoding="utf-8")
    policy = (firmware / "src" / "monitor.c").read_text(encoding="utf-8")
    rows = dict(
        (name, (int(periods), at_once == "true", int(returns)))
        for name, periods, at_once, returns in re.findall(
            r"\[FAULT_(\w+)\] = \{ (\d+)u, (true|false), (\d+)u \}", policy
        )
    )
    for name, bit, meaning in re.findall(r"FAULT_(\w+) = (\d+),? /\* (.+?) \*/", header):
        periods, at_once, returns = rows[name]
        yield {
            "bit": int(bit),
            "name": name.replace("_", " ").capitalize(),
            "meaning": meaning,
            "debounce_periods": periods,
            "stops_at_once": at_once,
            "returns": returns,
        }
