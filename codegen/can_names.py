"""Python names of the CAN database, for those who must not wait for a parser of it."""

from __future__ import annotations

from typing import Any

from cantools.database.can import Database
from cantools.database.can.c_source import camel_to_snake_case

from codegen.can_database import (
    BOOT_STAGE_ATTRIBUTE,
    ECU,
    OPTIONAL_ATTRIBUTE,
    PLANT,
    database_digest,
    load_database,
    network_version,
    number_attribute,
)
from codegen.rendering import environment

FILE_NAME = "catalog.py"


def can_names() -> dict[str, str]:
    """File name -> text: identifiers, message names and named values, as enumerations."""
    database = load_database()
    messages = sorted(database.messages, key=lambda message: message.frame_id)

    def sent_by(node: str, attribute: str, value: int) -> list[str]:
        return [
            m.name
            for m in messages
            if m.senders == [node]
            and m.length > 0
            and number_attribute(database, m, attribute) == value
        ]

    text = (
        environment()
        .get_template("can_names.py.j2")
        .render(
            digest=database_digest(),
            network_version=network_version(database),
            messages=[
                {"constant": _constant(m.name), "name": m.name, "id": m.frame_id} for m in messages
            ],
            required=sent_by(PLANT, OPTIONAL_ATTRIBUTE, 0),
            optional=sent_by(PLANT, OPTIONAL_ATTRIBUTE, 1),
            sent=sent_by(ECU, BOOT_STAGE_ATTRIBUTE, 0),
            tables=_tables(database),
        )
    )
    return {FILE_NAME: text}


def _tables(database: Database) -> list[dict[str, Any]]:
    """Every table of named values once, named after the first signal that has it."""
    signals_of: dict[tuple[tuple[str, int], ...], list[str]] = {}
    for message in database.messages:
        for signal in message.signals:
            if signal.choices:
                table = tuple((_constant(str(name)), int(n)) for n, name in signal.choices.items())
                signals_of.setdefault(table, []).append(signal.name)
    return [
        {"name": signals[0], "signals": signals, "choices": table}
        for table, signals in signals_of.items()
    ]


def _constant(name: str) -> str:
    return camel_to_snake_case(name).upper()
