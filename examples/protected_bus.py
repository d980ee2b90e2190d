"""Messages of bms.dbc on a CAN bus, with their end-to-end header: python-can and cantools alone.

AUTOSAR E2E profile 2: a CRC in byte 0, and a counter in the low half of byte 1, which chooses one
of the message's 16 data ids that the CRC covers too; docs/can.md lists them.
"""

import time
from itertools import cycle
from pathlib import Path

import can
import cantools
from cantools.autosar import compute_profile2_crc

DATABASE = Path(__file__).parents[1] / "codegen" / "can" / "bms.dbc"
DATA_IDS = "E2EProfile2DataIdList"
COUNTERS = 16


def open_bus(name: str) -> can.BusABC:
    """A bus named interface:channel in python-can's terms, for example socketcan:vcan0."""
    interface, _, channel = name.partition(":")
    # One hop more would send the frames out of the machine's network card.
    options = {"hop_limit": 0} if interface == "udp_multicast" else {}
    return can.Bus(interface=interface, channel=channel, **options)


class ProtectedBus:
    """The place of a node of the database, PLANT or ECU, on a bus."""

    def __init__(self, bus: can.BusABC, node: str) -> None:
        self._bus = bus
        messages = cantools.database.load_file(DATABASE).messages
        self._messages = {each.name: each for each in messages}
        self._heard = {each.frame_id: each for each in messages if node not in each.senders}
        self._data_ids = {
            each.name: bytes.fromhex(each.dbc.attributes[DATA_IDS].value)
            for each in messages if DATA_IDS in each.dbc.attributes
        }  # fmt: skip
        self._counters = {name: cycle(range(COUNTERS)) for name in self._data_ids}
        self._last_counter: dict[str, int] = {}

    def send(self, name: str, **values: float | str) -> None:
        """Send a message with these signals, in the units of the database."""
        message, data = self._messages[name], bytearray()
        if name in self._data_ids:
            counter = next(self._counters[name])
            data += message.encode({**values, f"{name}Crc": 0, f"{name}Counter": counter})
            data[0] = compute_profile2_crc(data, self._data_ids[name][counter])
        number = message.frame_id
        self._bus.send(can.Message(arbitration_id=number, is_extended_id=False, data=data))

    def receive(self, timeout_s: float) -> tuple[str, dict] | None:
        """Name and signals of the next message that is intact and new, or None after timeout_s.

        A signal is None where its sender has no value: the code lies above the signal's range.
        """
        end_s = time.monotonic() + timeout_s
        while (frame := self._bus.recv(max(0.0, end_s - time.monotonic()))) is not None:
            message = self._heard.get(frame.arbitration_id)
            is_data = not (frame.is_remote_frame or frame.is_error_frame or frame.is_extended_id)
            if message is None or not (is_data and self._is_intact_and_new(message, frame.data)):
                continue
            values = message.decode(frame.data)
            for signal in message.signals:
                if isinstance(value := values[signal.name], float) and value > signal.maximum:
                    values[signal.name] = None
            return message.name, values
        return None

    def _is_intact_and_new(self, message: cantools.database.can.Message, data: bytearray) -> bool:
        ids = self._data_ids.get(message.name)
        if ids is None or len(data) != message.length:
            return len(data) == message.length
        counter, last = data[1] % COUNTERS, self._last_counter.get(message.name)
        is_intact = data[0] == compute_profile2_crc(data, ids[counter])
        if is_intact:
            self._last_counter[message.name] = counter
        return is_intact and counter != last
