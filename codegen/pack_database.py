"""codegen/can/pack.dbc from a short description: three cells a page, 16 pages a message."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from codegen.can_database import PACK, data_ids, load_database
from codegen.rendering import environment

MOST_CELLS = 192
CELLS_A_PAGE = 3
PAGES_A_MESSAGE = 16
MESSAGES_A_GROUP = MOST_CELLS // (CELLS_A_PAGE * PAGES_A_MESSAGE)
PAGE_START, PAGE_LENGTH, VALUE_LENGTH = 12, 4, 16
_MODULUS = 251
"""Prime, and no more than a byte: multiples of a step below it come to each value but once."""


@dataclass(frozen=True)
class Group:
    """A quantity of every cell, in the pages of MESSAGES_A_GROUP messages."""

    name: str
    signal: str
    first_id: int
    sender: str
    scale: str
    offset: str
    limits: str
    unit: str
    pages_a_period: int
    """Pages that are sent in a control period, in turn; 0 for all."""
    comment: str


_VOLTAGE = ("0.0001", "0", "0|6.5533", "V")
_TEMPERATURE = ("0.005", "200", "200|527.665", "K")
_CHARGE = ("2e-05", "0", "0|1.31066", "1")
GROUPS = (
    Group(
        "CellVoltages", "Cell{:03d}Voltage", 0x210, "PLANT", *_VOLTAGE, 0,
        "Measured terminal voltage of each cell.",
    ),
    Group(
        "CellTemperatures", "Thermistor{:03d}Temperature", 0x220, "PLANT", *_TEMPERATURE, 0,
        "Measured surface temperature at each thermistor.",
    ),
    Group(
        "PlugInCharges", "Cell{:03d}PlugInCharge", 0x230, "PLANT", *_CHARGE, 7,
        "State of charge of each cell at plug-in, in turn; taken over when the charge begins.",
    ),
    Group(
        "CellCores", "Cell{:03d}CoreTemperature", 0x290, "ECU", *_TEMPERATURE, 2,
        "Core temperature estimate of each cell, in turn.",
    ),
    Group(
        "CellCharges", "Cell{:03d}StateOfCharge", 0x2A0, "ECU", *_CHARGE, 2,
        "Counted state of charge of each cell, in turn.",
    ),
    Group(
        "CellBleeds", "Cell{:03d}Bleed", 0x2B0, "ECU", *_CHARGE, 1,
        "Share of the time in which the bleed resistor of each cell is on, 0 or 1, in turn.",
    ),
)  # fmt: skip


def pack_database() -> dict[str, str]:
    """File name -> text of the database of packs."""
    names = [
        "PackElectrical", "PackCoolant", "PackRequest",
        *(f"{g.name}{m + 1}" for g in GROUPS[:-1] for m in range(MESSAGES_A_GROUP)),
        "PackCommand", "PackEstimate", "PackDecision", "PackDiagnostics", "PackFaults",
        "PackFunction", "PackSpread",
        *(f"{GROUPS[-1].name}{m + 1}" for m in range(MESSAGES_A_GROUP)),
    ]  # fmt: skip
    taken = [data_ids(message) for message in load_database().messages if data_ids(message)]
    lists: dict[str, str] = {}
    for name in names:
        chosen = _free_list(taken)
        taken.append(chosen)
        lists[name] = chosen.hex()
    faults = load_database().get_message_by_name("Diagnostics").get_signal_by_name("FirstFault")
    constraint = (
        load_database().get_message_by_name("Decision").get_signal_by_name("ActiveConstraint")
    )
    text = (
        environment()
        .get_template("pack.dbc.j2")
        .render(
            groups=[_group(group) for group in GROUPS],
            data_ids=lists,
            faults=_choices(faults.choices),
            constraints=_choices(constraint.choices),
        )
    )
    return {PACK: text}


def _choices(choices: Any) -> str:
    return " ".join(f'{value} "{name}"' for value, name in (choices or {}).items())


def _group(group: Group) -> dict[str, Any]:
    def page(message: int, number: int) -> list[dict[str, Any]]:
        first = (message * PAGES_A_MESSAGE + number) * CELLS_A_PAGE
        return [
            {
                "name": group.signal.format(first + place + 1),
                "page": number,
                "start": PAGE_START + PAGE_LENGTH + VALUE_LENGTH * place,
            }
            for place in range(CELLS_A_PAGE)
        ]

    return {
        "description": group,
        "messages": [
            {
                "name": f"{group.name}{message + 1}",
                "id": group.first_id + message,
                "signals": [s for p in range(PAGES_A_MESSAGE) for s in page(message, p)],
            }
            for message in range(MESSAGES_A_GROUP)
        ],
    }


def _free_list(taken: Iterable[bytes]) -> bytes:
    """16 different data ids that share with no other list the id of a counter."""
    others = list(taken)
    for step in range(2, _MODULUS):
        for start in range(_MODULUS):
            ids = bytes((start + step * k) % _MODULUS for k in range(16))
            if all(a != b for other in others for a, b in zip(ids, other)):
                return ids
    raise AssertionError("a database of this size has room for more lists")
