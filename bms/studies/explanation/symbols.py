"""Names of quantities in formulas."""

from __future__ import annotations

import re

_INPUTS = {
    "current_A": ("I", "I"),
    "cooling_power_W": ("Qc", "Q_c"),
    "surface_temperature_K": ("Ts", "T_s"),
    "coolant_temperature_K": ("Tinf", r"T_{\infty}"),
}
_LAGGED = {
    "current_squared_A2": ("I2lag", r"\overline{{I^2}}_{{{0}}}"),
    "surface_temperature_rise_K": ("dTslag", r"\Delta T_{{s,{0}}}"),
}
_LAGGED_NAME = re.compile(r"(\w+)_filtered_([\d.e+-]+)s")


def input_symbol(name: str) -> tuple[str, str]:
    """Text (an identifier) and LaTeX symbol of an input of the network."""
    if name in _INPUTS:
        return _INPUTS[name]
    lagged = _LAGGED_NAME.fullmatch(name)
    if lagged and lagged[1] in _LAGGED:
        text, latex = _LAGGED[lagged[1]]
        return f"{text}_{re.sub(r'[^0-9]', '_', lagged[2])}s", latex.format(lagged[2])
    return re.sub(r"\W", "_", name), rf"\mathrm{{{name}}}".replace("_", r"\_")


def input_unit(name: str) -> str:
    """Unit at the end of an input's name; empty for inputs without one."""
    if lagged := _LAGGED_NAME.fullmatch(name):
        name = lagged[1]
    unit = {"A": "A", "A2": "A²", "W": "W", "K": "K"}
    return unit.get(name.rpartition("_")[2], "")


def node_symbol(layer: int, node: int) -> tuple[str, str]:
    """Text and LaTeX symbol of a hidden node, both counted from 1."""
    return f"h{layer}_{node}", f"h_{{{layer},{node}}}"
