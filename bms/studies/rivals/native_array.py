"""Arrays that C reads or writes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from bms.arrays import Array
from bms.studies.rivals._rivals import ffi


def float_array(values: npt.ArrayLike) -> Any:
    """A float[] with the values in order; the caller keeps it alive."""
    return ffi.new("float[]", np.asarray(values, dtype=np.float64).ravel().tolist())


def pointer(values: npt.NDArray[Any]) -> Any:
    """The memory of a contiguous array of float32 or uint32."""
    kind = "float[]" if values.dtype == np.float32 else "uint32_t[]"
    return ffi.from_buffer(kind, values, require_writable=False)


def filled(fill: Any, rows: int) -> Array:
    """What `fill(float *)` writes, `rows` numbers, in double precision."""
    values = np.empty(rows, dtype=np.float32)
    fill(ffi.from_buffer("float[]", values, require_writable=True))
    return values.astype(np.float64)
