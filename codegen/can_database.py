"""The CAN databases of the project, of one cell and of a pack: every message and signal."""

from __future__ import annotations

import hashlib
from importlib.resources import files

import cantools
from cantools.database.can import Database, Message

CYCLE_ATTRIBUTE = "GenMsgCycleTime"
TIMEOUT_ATTRIBUTE = "MessageTimeoutTime"
DATA_IDS_ATTRIBUTE = "E2EProfile2DataIdList"
OPTIONAL_ATTRIBUTE = "MessageIsOptional"
BOOT_STAGE_ATTRIBUTE = "MessageIsFromBootStage"
ECU, PLANT = "ECU", "PLANT"
ONE_CELL, PACK = "bms.dbc", "pack.dbc"
"""Files of the databases in codegen/can."""


def database_text(name: str = ONE_CELL) -> str:
    """Text of a database, as it is hashed and parsed."""
    return (files("codegen") / "can" / name).read_text(encoding="utf-8")


def database_digest(name: str = ONE_CELL) -> str:
    """SHA-256 of a database, as hexadecimal text."""
    return hashlib.sha256(database_text(name).encode()).hexdigest()


def load_database(name: str = ONE_CELL) -> Database:
    """A database as cantools parses it: messages, signals, attributes."""
    database = cantools.database.load_string(database_text(name), database_format="dbc")
    assert isinstance(database, Database)
    return database


def network_version(database: Database) -> int:
    """Version of the frames' layout; one goes up whenever an old reader would misread a frame."""
    return int(database.version or 0)


def number_attribute(database: Database, message: Message, name: str) -> int:
    """Value of a message's attribute, or the database's default."""
    assert message.dbc is not None and database.dbc is not None
    own = message.dbc.attributes.get(name)
    value = own.value if own else database.dbc.attribute_definitions[name].default_value
    assert isinstance(value, int)
    return value


def data_ids(message: Message) -> bytes:
    """The 16 data ids of AUTOSAR E2E profile 2; empty for an unprotected message."""
    attributes = message.dbc.attributes if message.dbc else {}
    own = attributes.get(DATA_IDS_ATTRIBUTE)
    return bytes.fromhex(str(own.value)) if own else b""
