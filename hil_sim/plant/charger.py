"""The charger: supplies what the ECU commands, and nothing once the command is too old."""

from __future__ import annotations

import math

from bms.errors import InputError
from bms.presets import Preset


class Charger:
    """Obeys commands within [reference current, 0 A], delay_periods after they arrive.

    A command is obeyed for no longer than the controller's margins cover it, that is until
    sampling period + delay of the preset after its measurement: with the shipped presets one
    period may go without a command, at the second in a row the current is 0 A at once. A
    delayed charger has used up that reserve and stops at the first.

    A charger as it is supplies (1 + tolerance) times what is commanded, and follows with a lag of
    first order. The current of a period is the one that the lag reaches at its end, so that the
    next reading of it is right.

    Raises InputError when the delay exceeds the one of the preset.
    """

    def __init__(
        self, preset: Preset, delay_periods: int = 0, tolerance: float = 0.0, lag_s: float = 0.0
    ) -> None:
        timing = preset.timing
        covered_periods = 1 + int(timing.delay_s / timing.sampling_period_s + 1e-9)
        if not 0 <= delay_periods < covered_periods:
            raise InputError(
                f"charger delay of {delay_periods} periods: preset '{preset.name}' covers "
                f"0 to {covered_periods - 1}; raise timing.delay_s"
            )
        self.silent_periods_to_stop = covered_periods - delay_periods
        self._reference_A = preset.limits.reference_current_A
        self._pending: list[float | None] = [None] * delay_periods
        self._held_A = 0.0
        self._silent_periods = 0
        self._gain = 1.0 + tolerance
        self._share = lag_share(timing.sampling_period_s, lag_s)
        self._lagged_A = 0.0

    def current_A(self, command_A: float | None) -> float:
        """Current of the coming period in A; None stands for no intact command in this one."""
        self._pending.append(command_A)
        command_A = self._pending.pop(0)
        if command_A is None:
            self._silent_periods += 1
        else:
            self._silent_periods = 0
            self._held_A = min(max(command_A, self._reference_A), 0.0)
        if self._silent_periods >= self.silent_periods_to_stop:
            self._held_A = 0.0
        if self._share == 1.0:
            self._lagged_A = self._held_A
        else:
            self._lagged_A += self._share * (self._held_A - self._lagged_A)
        return self._gain * self._lagged_A


def lag_share(period_s: float, lag_s: float) -> float:
    """Share of the way to a command that a lag of first order goes in a period; 1 without a lag."""
    return 1.0 - math.exp(-period_s / lag_s) if lag_s > 0.0 else 1.0
