"""Builds bms.studies.rivals._rivals: the other estimators in C behind cffi, for a host only."""

from __future__ import annotations

from bms.native_build import NativeExtension

_NATIVE = "bms/studies/rivals/native"
RIVALS = NativeExtension(
    module="bms.studies.rivals._rivals",
    folders=(_NATIVE,),
    headers=tuple(
        f"{_NATIVE}/{name}.h"
        for name in ("linear", "quadratic", "mlp", "thermal", "covariance", "kalman", "rows")
    ),
    libraries=("m",),
)
