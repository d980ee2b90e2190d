"""Firmware ECUs that misbehave in one way."""

from bms.firmware import Ecu
from bms.model import load_shipped_model

IDENTITY_ID = 0x185


class SilentAfter:
    """The firmware, until it says nothing any more after some steps."""

    def __init__(self, preset, steps):
        self._ecu = Ecu(preset=preset)
        self._steps_left = steps

    def receive(self, frame_id, data):
        self._ecu.receive(frame_id, data)

    def step(self):
        self._ecu.step()
        self._steps_left -= 1

    def transmit(self):
        frames = self._ecu.transmit()
        return frames if self._steps_left >= 0 else []


class OftenDamaged:
    """The firmware, with a damaged charge command before each intact one after some steps."""

    def __init__(self, preset, steps):
        self._ecu = Ecu(preset=preset)
        self.receive = self._ecu.receive
        self._steps_left = steps

    def step(self):
        self._ecu.step()
        self._steps_left -= 1

    def transmit(self):
        *others, (command_id, data) = self._ecu.transmit()
        damaged = (
            [] if self._steps_left >= 0 else [(command_id, data[:-1] + bytes([~data[-1] & 255]))]
        )
        return [*others, *damaged, (command_id, data)]


class Contradicting:
    """The firmware, some of whose Identity messages after its first have other hashes."""

    def __init__(self, preset, times, is_of_this_version=True):
        self._ecu = Ecu(preset=preset)
        self.receive, self.step = self._ecu.receive, self._ecu.step
        self._sent = 0
        self._times = times
        self._is_of_this_version = is_of_this_version

    def transmit(self):
        return [
            (frame_id, self._changed(frame_id, data)) for frame_id, data in self._ecu.transmit()
        ]

    def _changed(self, frame_id, data):
        self._sent += frame_id == IDENTITY_ID
        is_changed = frame_id == IDENTITY_ID and 1 < self._sent <= 1 + self._times
        flipped = slice(0, 6) if self._is_of_this_version else slice(0, 8)
        changed = bytes(byte ^ 0xFF for byte in data[flipped]) + data[flipped.stop :]
        return changed if is_changed else data


class HotterThanAllowed:
    """The firmware with temperature limits that are too high by some kelvin, and no identity."""

    def __init__(self, preset, excess_K):
        changes = {
            name: getattr(preset.limits, name) + excess_K
            for name in ("max_core_temperature_K", "max_surface_temperature_K")
        }
        self._ecu = Ecu(preset, load_shipped_model(preset.name), changes=changes)
        self.receive, self.step = self._ecu.receive, self._ecu.step

    def transmit(self):
        return [frame for frame in self._ecu.transmit() if frame[0] != IDENTITY_ID]
