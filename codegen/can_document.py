"""docs/can.md: the CAN database for people, with the faults that the firmware reports on it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cantools.database.can import Database, Message, Signal

from codegen.can_database import (
    CYCLE_ATTRIBUTE,
    ECU,
    TIMEOUT_ATTRIBUTE,
    data_ids,
    load_database,
    number_attribute,
)
from codegen.rendering import environment

_LIMITS = (
    "E2EMaxDeltaCounter",
    "E2EWindowSize",
    *("E2EMinOkStateInit", "E2EMaxErrorStateInit"),
    *("E2EMinOkStateValid", "E2EMaxErrorStateValid"),
    *("E2EMinOkStateInvalid", "E2EMaxErrorStateInvalid"),
)


def can_document(firmware: Path) -> str:
    """Text of docs/can.md from the database and firmware/{include/monitor.h,src/monitor.c}."""
    database = load_database()
    messages = sorted(database.messages, key=lambda message: message.frame_id)
    return (
        environment()
        .get_template("can.md.j2")
        .render(
            messages=[_message(database, message) for message in messages],
            limit_names=[name.removeprefix("E2E") for name in _LIMITS],
            faults=list(_faults(firmware)),
        )
    )


def _message(database: Database, message: Message) -> dict[str, Any]:
    is_for_ecu = message.senders != [ECU]
    timeout_ms = number_attribute(database, message, TIMEOUT_ATTRIBUTE)
    return {
        "name": message.name,
        "id": message.frame_id,
        "length": message.length,
        "direction": "plant to ECU" if is_for_ecu else "ECU to plant",
        "cycle_ms": number_attribute(database, message, CYCLE_ATTRIBUTE),
        "timeout_ms": timeout_ms,
        "is_protected": bool(data_ids(message)),
        "is_supervised": timeout_ms > 0 and bool(data_ids(message)),
        "limits": [number_attribute(database, message, name) for name in _LIMITS],
        "data_ids": data_ids(message).hex(" "),
        "comment": message.comment,
        "signals": [_signal(signal) for signal in message.signals],
    }


def _signal(signal: Signal) -> dict[str, Any]:
    choices = {int(value): str(name) for value, name in (signal.choices or {}).items()}
    notes = [", ".join(f"{value} = {name}" for value, name in choices.items())]
    return {
        "name": signal.name,
        "bits": f"{signal.start}…{signal.start + signal.length - 1}",
        "range": f"{signal.minimum:.10g} … {signal.maximum:.10g}",
        "resolution": f"{signal.scale:g}",
        "unit": signal.unit or "",
        "not_available": f"0x{2**signal.length - 1:X}" if signal.unit else "",
        "note": "; ".join(filter(None, [*notes, signal.comment])),
    }


def _faults(firmware: Path) -> Iterator[dict[str, Any]]:
    header = (firmware / "include" / "monitor.h").read_text(encoding="utf-8")
    policy = (firmware / "src" / "monitor.c").read_text(encoding="utf-8")
    rows = dict(
        (name, (int(periods), at_once == "true"))
        for name, periods, at_once in re.findall(
            r"\[FAULT_(\w+)\] = \{ (\d+)u, (true|false) \}", policy
        )
    )
    for name, bit, meaning in re.findall(r"FAULT_(\w+) = (\d+),? /\* (.+?) \*/", header):
        periods, at_once = rows[name]
        yield {
            "bit": int(bit),
            "name": name.replace("_", " ").capitalize(),
            "meaning": meaning,
            "debounce_periods": periods,
            "stops_at_once": at_once,
        }
