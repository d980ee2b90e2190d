"""docs/can-pack.md: the CAN database of packs for people."""

from __future__ import annotations

from typing import Any

from codegen.can_database import PACK, load_database, network_version, number_attribute
from codegen.can_document import described_message, described_signal
from codegen.pack_database import CELLS_A_PAGE, GROUPS, MESSAGES_A_GROUP, PAGES_A_MESSAGE, Group
from codegen.pack_sources import PAGES_ATTRIBUTE
from codegen.rendering import environment


def pack_document() -> str:
    """Text of docs/can-pack.md from the database."""
    database = load_database(PACK)
    messages = sorted(database.messages, key=lambda message: message.frame_id)
    return (
        environment()
        .get_template("can_pack.md.j2")
        .render(
            version=network_version(database),
            messages=[
                {
                    **described_message(database, message),
                    "pages_a_period": number_attribute(database, message, PAGES_ATTRIBUTE),
                    "is_paged": message.is_multiplexed(),
                }
                for message in messages
            ],
            groups=[_group(group) for group in GROUPS],
            cells_a_page=CELLS_A_PAGE,
            cells_a_message=CELLS_A_PAGE * PAGES_A_MESSAGE,
            pages=PAGES_A_MESSAGE,
        )
    )


def _group(group: Group) -> dict[str, Any]:
    database = load_database(PACK)
    first = database.get_message_by_name(f"{group.name}1")
    signal = next(s for s in first.signals if s.multiplexer_ids)
    return {
        "name": group.name,
        "messages": MESSAGES_A_GROUP,
        "first_id": group.first_id,
        "first": group.signal.format(1),
        "comment": group.comment,
        "pages_a_period": group.pages_a_period,
        "signal": described_signal(signal),
    }
