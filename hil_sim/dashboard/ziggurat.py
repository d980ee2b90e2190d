"""The tables of numpy's normal random numbers, found by asking numpy.

numpy draws them by a ziggurat of 256 strips whose tables it does not hand out, and their last bits
depend on how they were computed once. So a generator is set to a state whose next output is known,
and what the number becomes tells the table. Source: G. Marsaglia and W. W. Tsang, The Ziggurat
Method (2000).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

STRIPS = 256
_PLACES = 1 << 52
_FACTOR = 0x2360ED051FC65DA44385DF649FCCF645
_MODULUS = 1 << 128
_INVERSE = pow(_FACTOR, -1, _MODULUS)
_SIGN_BITS = 9  # 8 of the strip, one of the sign


def ziggurat_tables() -> dict[str, Any]:
    """Initialiser of a `normals_tables_t`, see hil_sim/dashboard/native/normals.h."""
    probe = _Probe()
    step = [probe.draw(strip, 1)[0] for strip in range(STRIPS)]
    return {
        "inside": [_first_refused(probe, strip) for strip in range(STRIPS)],
        "step": step,
        "density": [1.0, *(math.exp(-0.5 * (_PLACES * s) ** 2) for s in step[1:])],
        "tail": _PLACES * step[STRIPS - 1],
        "tail_inverse": 1.0 / (_PLACES * step[STRIPS - 1]),
    }


class _Probe:
    """A generator whose next 64 bits are chosen."""

    def __init__(self) -> None:
        self._bits = np.random.PCG64(0)
        self._generator = np.random.Generator(self._bits)
        self._state: Any = self._bits.state
        self._increment: int = self._state["state"]["inc"]

    def draw(self, strip: int, place: int) -> tuple[float, bool]:
        """The normal number of a place in a strip, and whether one output was enough for it."""
        # A state below 2^64 is put out as it is.
        after = strip | place << _SIGN_BITS
        before = (after - self._increment) * _INVERSE % _MODULUS
        self._state["state"]["state"] = before
        self._bits.state = self._state
        value = float(self._generator.standard_normal())
        now: Any = self._bits.state
        return value, now["state"]["state"] == after


def _first_refused(probe: _Probe, strip: int) -> int:
    low, high = 0, _PLACES  # below low all are accepted, none from high on
    while low < high:
        middle = (low + high) // 2
        if probe.draw(strip, middle)[1]:
            low = middle + 1
        else:
            high = middle
    return low
