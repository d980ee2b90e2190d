"""The ECU of a pack behind cffi: frames in, a step for each control period, frames out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hil_sim.bus.frame import Frame
from hil_sim.pack.frames import FRAME, packed, unpacked
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.studies.pack._pack import ffi, lib

_MOST_KEPT_BYTES = 300 * FRAME.size


class PackEcu:
    """One ECU with its own state; `state` is the C structure with everything that is known."""

    def __init__(self, settings: PackChargeSettings) -> None:
        """Raises InputError or ModelMismatchError as PackChargeSettings.core does."""
        self._core = settings.core()  # C points to its calibration
        owners = settings.view.thermistors
        kept_map = ffi.new("uint8_t[]", settings.view.thermistor_of)
        self.state: Any = ffi.new("pack_ecu_t *")
        now, soon = settings.horizons()
        config = {
            "now": now,
            "soon": soon,
            "balance": settings.balance(),
            "pack": {
                "calibration": self._core.calibration,
                "cells": settings.cells,
                "thermistors": len(owners),
                "thermistor_of": kept_map,  # until pack_init has read it
                "bare": self._core.reserves.bare,
            },
            "pack_voltage_error_V": settings.pack_voltage_error_V,
        }
        lib.pack_ecu_init(self.state, ffi.new("pack_ecu_config_t *", config))
        self._sent = ffi.new("can_frame_t[]", lib.PACK_ECU_OUTBOX)
        self._waiting = bytearray()
        self._answers: list[Frame] = []

    def receive(self, frame_id: int, data: bytes) -> None:
        """Take any frame with up to 8 data bytes."""
        self._waiting += packed([(frame_id, data)])
        if len(self._waiting) >= _MOST_KEPT_BYTES:
            self._hand_on()

    def step(self) -> None:
        """Run one control period; messages that did not come since the last one are missing."""
        self._answers = self.exchange(())

    def transmit(self) -> list[Frame]:
        """Frames of this step in order; the command is the last."""
        return self._answers

    def exchange(self, frames: Sequence[tuple[int, bytes]]) -> list[Frame]:
        """A control period by one call of C: receive these frames, step, transmit."""
        content = bytes(self._waiting) + packed(frames)
        self._waiting.clear()
        count = lib.pack_wire_exchange(
            self.state,
            ffi.from_buffer("can_frame_t[]", content),
            len(content) // FRAME.size,
            self._sent,
        )
        return unpacked(self._sent, count)

    def _hand_on(self) -> None:
        """Frames of a stream without SYNC must not pile up."""
        array = ffi.from_buffer("can_frame_t[]", bytes(self._waiting))
        for i in range(len(self._waiting) // FRAME.size):
            lib.pack_ecu_receive(self.state, ffi.addressof(array, i))
        self._waiting.clear()
