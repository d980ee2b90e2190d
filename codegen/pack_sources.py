"""C tables of the CAN layer of packs: messages, signals, and pages of three cells each."""

from __future__ import annotations

from typing import Any

from cantools.database.can import Database, Message, Signal
from cantools.database.can.c_source import camel_to_snake_case

from codegen.can_database import (
    CYCLE_ATTRIBUTE,
    ECU,
    PACK,
    PLANT,
    TIMEOUT_ATTRIBUTE,
    database_digest,
    load_database,
    network_version,
    number_attribute,
)
from codegen.can_sources import RESERVED_CODES, message_fields, signal_fields
from codegen.pack_database import (
    CELLS_A_PAGE,
    GROUPS,
    MESSAGES_A_GROUP,
    MOST_CELLS,
    PAGE_LENGTH,
    PAGE_START,
    PAGES_A_MESSAGE,
    VALUE_LENGTH,
    Group,
)
from codegen.rendering import environment

PAGES_ATTRIBUTE = "PagesAPeriod"
LAST = "PackCommand"
"""Ends a period for whoever waits for it."""


def pack_sources() -> dict[str, str]:
    """File name -> text for pack_catalog.{h,c}."""
    database = load_database(PACK)
    template_data = {
        "digest": database_digest(PACK),
        "network_version": network_version(database),
        "sync_id": database.get_message_by_name("SYNC").frame_id,
        "received": _singles(database, PLANT),
        "transmitted": _singles(database, ECU),
        "signals": [
            _signal(s) for m in database.messages if m.length and not m.is_multiplexed()
            for s in m.signals if not s.name.startswith(m.name)
        ],
        "groups": [_group(database, group) for group in GROUPS],
        "cells": MOST_CELLS,
        "cells_a_page": CELLS_A_PAGE,
        "pages_a_message": PAGES_A_MESSAGE,
        "messages_a_group": MESSAGES_A_GROUP,
        "page_start": PAGE_START,
        "value_start": PAGE_START + PAGE_LENGTH,
        "value_length": VALUE_LENGTH,
    }  # fmt: skip
    jinja = environment()
    return {
        name: jinja.get_template(f"{name}.j2").render(template_data)
        for name in ("pack_catalog.h", "pack_catalog.c")
    }


def _singles(database: Database, sender: str) -> list[dict[str, Any]]:
    """Messages without pages; the one that ends a period last."""
    found = [
        m
        for m in database.messages
        if m.senders == [sender] and m.length > 0 and not m.is_multiplexed()
    ]
    found.sort(key=lambda m: (m.name == LAST, m.frame_id))
    return [message_fields(database, m) for m in found]


def _signal(signal: Signal) -> dict[str, Any]:
    """A code without a unit has no reserved values of its own."""
    reserved = RESERVED_CODES if signal.unit else 0
    return {
        **signal_fields(signal),
        "start": signal.start,
        "length": signal.length,
        "raw_max": 2**signal.length - 1 - reserved,
    }


def _group(database: Database, group: Group) -> dict[str, Any]:
    messages = [
        database.get_message_by_name(f"{group.name}{m + 1}") for m in range(MESSAGES_A_GROUP)
    ]
    values = [_values(message) for message in messages]
    assert all(own == values[0] for own in values), "pages of a group differ"
    ids = [message.frame_id for message in messages]
    assert ids == list(range(ids[0], ids[0] + MESSAGES_A_GROUP)), "the C code counts on it"
    first = values[0][0]
    period_ms = number_attribute(database, database.get_message_by_name("SYNC"), CYCLE_ATTRIBUTE)
    return {
        "name": camel_to_snake_case(group.name).upper(),
        "messages": [message_fields(database, message) for message in messages],
        "scaling": first["scaling"],
        "pages_a_period": number_attribute(database, messages[0], PAGES_ATTRIBUTE),
        "timeout_periods": number_attribute(database, messages[0], TIMEOUT_ATTRIBUTE) // period_ms,
    }


def _values(message: Message) -> list[dict[str, Any]]:
    """Place and scaling of the signals of all pages, which the C code takes to be alike."""
    found = []
    for signal in message.signals:
        if signal.multiplexer_ids:
            place = (signal.start - PAGE_START - PAGE_LENGTH) // VALUE_LENGTH
            assert signal.length == VALUE_LENGTH, signal.name
            found.append(
                {
                    "page": signal.multiplexer_ids[0],
                    "place": place,
                    "scaling": {k: v for k, v in signal_fields(signal).items() if k != "name"},
                }
            )
    found.sort(key=lambda value: (value["page"], value["place"]))
    assert [(v["page"], v["place"]) for v in found] == [
        (page, place) for page in range(PAGES_A_MESSAGE) for place in range(CELLS_A_PAGE)
    ], message.name
    assert all(v["scaling"] == found[0]["scaling"] for v in found), message.name
    return found
