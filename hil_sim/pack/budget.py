"""What a control period of a pack takes of its bus, computed from the database."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from cantools.database.can import Message

from bms.errors import InputError
from codegen.can_database import CYCLE_ATTRIBUTE, PACK, load_database, number_attribute
from codegen.pack_database import CELLS_A_PAGE, GROUPS, MOST_CELLS
from codegen.pack_sources import PAGES_ATTRIBUTE

BIT_RATES = (125_000, 250_000, 500_000, 1_000_000)
"""Of classical CAN, as CiA 102 recommends them."""
_STUFFED_OVERHEAD_BITS = 34
"""Start, identifier, control and CRC of a frame with 11 bits of identifier. Source: ISO 11898-1."""
_PLAIN_BITS = 13
"""CRC delimiter, acknowledgement, end of frame and the space to the next one."""
_THERMISTOR_GROUP = "CellTemperatures"


def most_bits(data_bytes: int) -> int:
    """Longest that a frame can be: a stuff bit after five equal ones, then after each four."""
    stuffed = _STUFFED_OVERHEAD_BITS + 8 * data_bytes
    return stuffed + (stuffed - 1) // 4 + _PLAIN_BITS


@dataclass(frozen=True)
class Budget:
    """Frames and bits of the fullest period of a pack."""

    cells: int
    thermistors: int
    frames: int
    bits: int
    period_ms: int

    def load(self, bit_rate: int) -> float:
        """Share of the period that the bus is busy, at a bit rate in bit/s; more than 1 is no."""
        return self.bits / (bit_rate * self.period_ms / 1000.0)


def budget(cells: int, thermistors: int | None = None) -> Budget:
    """Of a pack of so many cells, with a thermistor at each if not told otherwise.

    All messages that are sent more seldom than every period are taken to meet in one.
    """
    count = cells if thermistors is None else thermistors
    if not 1 <= cells <= MOST_CELLS or not 0 <= count <= cells:
        raise InputError(f"--cells {cells}: the database has room for 1 to {MOST_CELLS} cells")
    lengths = list(_lengths(cells, count))
    return Budget(cells, count, len(lengths), sum(map(most_bits, lengths)), _period_ms())


def require_fit(need: Budget, bit_rate: int, share: float = 1.0, per_thermistor: int = 1) -> None:
    """Raise InputError for a period that is too long for its bus.

    It says what would fit, with as many cells for each thermistor.
    """
    if need.load(bit_rate) <= share:
        return
    fitting = [rate for rate in BIT_RATES if need.load(rate) <= share]
    most = most_cells(bit_rate, share, per_thermistor)
    remedies = [f"take {most} cells at most"] if most else []
    if fitting:
        remedies.append(f"a bus of {fitting[0] // 1000} kbit/s")
    raise InputError(
        f"{need.cells} cells: a period of {need.period_ms} ms takes {need.frames} frames, "
        f"{need.bits} bits, {100.0 * need.load(bit_rate):.1f} % of a bus of {bit_rate / 1000:g} "
        f"kbit/s, of which {100.0 * share:g} % may be used; "
        + (", or ".join(remedies) or "no bit rate of classical CAN fits")
    )


def most_cells(bit_rate: int, share: float = 1.0, per_thermistor: int = 1) -> int:
    """Most cells, with a thermistor for each so many, whose period fits."""
    numbers = range(1, MOST_CELLS + 1)
    fits = [n for n in numbers if budget(n, -(-n // per_thermistor)).load(bit_rate) <= share]
    return max(fits, default=0)


@cache
def _messages() -> tuple[tuple[Message, int], ...]:
    database = load_database(PACK)
    return tuple((m, number_attribute(database, m, PAGES_ATTRIBUTE)) for m in database.messages)


@cache
def _period_ms() -> int:
    database = load_database(PACK)
    return number_attribute(database, database.get_message_by_name("SYNC"), CYCLE_ATTRIBUTE)


def _lengths(cells: int, thermistors: int) -> Iterator[int]:
    """Data bytes of every frame of the fullest period."""
    for message, _ in _messages():
        if not message.is_multiplexed():
            yield message.length
    for group in GROUPS:
        values = thermistors if group.name == _THERMISTOR_GROUP else cells
        pages = -(-values // CELLS_A_PAGE)
        own = [(m, n) for m, n in _messages() if m.name.startswith(group.name)]
        a_period = own[0][1]
        for _ in range(min(pages, a_period) if a_period else pages):
            yield own[0][0].length
