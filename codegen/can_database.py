"""The CAN database of the project, the single source of every message and signal."""

from __future__ import annotations

from importlib.resources import files

import cantools
from cantools.database.can import Database, Message

E2E_ATTRIBUTE = "E2EProfile2DataIdList"
ECU, PLANT = "ECU", "PLANT"


def database_text() -> str:
    """Text of bms.dbc."""
    return (files("codegen") / "can" / "bms.dbc").read_text(encoding="utf-8")


def load_database() -> Database:
    """The parsed database."""
    database = cantools.database.load_string(database_text(), database_format="dbc")
    assert isinstance(database, Database)
    return database


def data_ids(message: Message) -> bytes:
    """The 16 data ids of AUTOSAR E2E profile 2; empty for an unprotected message."""
    attributes = message.dbc.attributes if message.dbc else {}
    attribute = attributes.get(E2E_ATTRIBUTE)
    return bytes.fromhex(str(attribute.value)) if attribute else b""
