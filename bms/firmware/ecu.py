"""The whole ECU application of the firmware: frames in, steps, frames out."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

from bms.calibration import NO_CHANGES
from bms.firmware._firmware import ffi, lib
from bms.firmware.calibration import calibration_block
from bms.model.model_file import KanModel
from bms.model.pair import load_pair
from bms.presets import Preset

_FRAME_BYTES = len(ffi.new("can_frame_t *").data)
_FRAME = struct.Struct(f"=IB{_FRAME_BYTES}s3x")
assert _FRAME.size == ffi.sizeof("can_frame_t")
_MOST_ANSWERS = 16


class Ecu:
    """One ECU with its own state. `preset` and `model` as in Firmware, with the same errors.

    `changes` sets constants of the controller to other values, for studies: the names are fields
    of bms_calibration_t or of its barrier part, InputError for one that does not exist.
    """

    def __init__(
        self,
        preset: str | Path | Preset,
        model: str | Path | KanModel | None = None,
        changes: Mapping[str, float] = NO_CHANGES,
    ) -> None:
        self.preset, self.model = load_pair(preset, model)
        self._calibration = calibration_block(
            self.preset,
            self.model,
            compiled_in=model is None and not changes,
            changes=changes,
        )
        self._state = ffi.new("bms_t *")
        self._frame = ffi.new("can_frame_t *")
        self._sent = ffi.new("can_frame_t[]", _MOST_ANSWERS)
        self._sent_bytes = ffi.buffer(self._sent)
        config = ffi.new("bms_config_t *", {"calibration": self._calibration})
        lib.bms_init(self._state, config)
        content = lib.content_of_calibration(self._calibration)
        lib.bms_tell_start(self._state, ffi.new("bms_start_t *", {"calibration_content": content}))

    def receive(self, frame_id: int, data: bytes) -> None:
        """Take any frame with an 11-bit or 29-bit identifier and up to 8 data bytes."""
        frame = self._frame
        frame.id, frame.length = frame_id, min(len(data), _FRAME_BYTES + 1)
        ffi.memmove(frame.data, data, min(len(data), _FRAME_BYTES))
        lib.bms_receive(self._state, frame)

    def step(self) -> None:
        """Run one control period; messages that did not come since the last one are missing."""
        lib.bms_step(self._state)

    def transmit(self) -> list[tuple[int, bytes]]:
        """Identifier and data of the frames of this period; the charge command is the last."""
        frames = []
        frame = self._frame
        while lib.bms_transmit(self._state, frame):
            frames.append((frame.id, bytes(ffi.buffer(frame.data, frame.length))))
        return frames

    def exchange(self, frames: Sequence[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
        """A control period by one call of C: receive these frames, step, transmit."""
        content = b"".join(
            [_FRAME.pack(i, min(len(data), _FRAME_BYTES + 1), data) for i, data in frames]
        )
        count = lib.host_exchange(
            self._state,
            ffi.from_buffer("can_frame_t[]", content),
            len(frames),
            self._sent,
            _MOST_ANSWERS,
        )
        sent = bytes(self._sent_bytes[: count * _FRAME.size])
        answers = [(i, data[:length]) for i, length, data in _FRAME.iter_unpack(sent)]
        return answers if count < _MOST_ANSWERS else answers + self.transmit()
