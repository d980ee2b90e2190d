"""A BPX file of a published cell, an LG M50 21700.

Electrodes, capacity, voltages, volume and surface: Chen et al. 2020 (J. Electrochem. Soc. 167
080534), its single-particle part; dU/dT of both electrodes: O'Regan et al. 2022 (Electrochimica
Acta 425, 140700), that of the positive one as a table of its function. Density is a mass of 68.4 g
in that volume. Specific heat, heat transfer and conductivity are round numbers of a usual size.
"""

from __future__ import annotations

import json
from math import exp, tanh
from pathlib import Path
from typing import Any

_X = [0.02 * place for place in range(51)]


def positive_entropy_V_per_K(x: float) -> float:
    return (
        0.04006 * exp(-((x - 0.2828) ** 2) / 0.0009855)
        - 0.06656 * exp(-((x - 0.8032) ** 2) / 0.02179)
    ) / 1000


def negative_entropy_V_per_K(x: float) -> float:
    return (-0.1112 * x + 0.02914 + 0.3561 * exp(-((x - 0.08309) ** 2) / 0.004616)) / 1000


def positive_V(x: float) -> float:
    return (
        -0.8090 * x + 4.4875 - 0.0428 * tanh(18.5138 * (x - 0.5542))
        - 17.7326 * tanh(15.7890 * (x - 0.3117)) + 17.5842 * tanh(15.9308 * (x - 0.3120))
    )  # fmt: skip


def negative_V(x: float) -> float:
    return (
        1.9793 * exp(-39.3631 * x) + 0.2482 - 0.0909 * tanh(29.8538 * (x - 0.1234))
        - 0.04478 * tanh(14.9159 * (x - 0.2769)) - 0.0205 * tanh(30.4444 * (x - 0.6103))
    )  # fmt: skip


def lg_m50() -> dict[str, Any]:
    """Content of the file, version 1.1; a new one each time, to be changed at will."""
    return {
        "Header": {
            "BPX": "1.1.0",
            "Title": "LG M50",
            "References": "Chen et al. 2020, O'Regan et al. 2022",
            "Model": "SPM",
        },
        "Parameterisation": {
            "Cell": {
                "Electrode area [m2]": 0.1027,
                "External surface area [m2]": 0.00531,
                "Volume [m3]": 2.42e-05,
                "Number of electrode pairs connected in parallel to make a cell": 1,
                "Lower voltage cut-off [V]": 2.5,
                "Upper voltage cut-off [V]": 4.2,
                "Nominal cell capacity [A.h]": 5.0,
                "Reference temperature [K]": 298.15,
                "Density [kg.m-3]": 2826.0,
                "Specific heat capacity [J.K-1.kg-1]": 1000.0,
            },
            "Negative electrode": {
                "Thickness [m]": 8.52e-05,
                "Minimum stoichiometry": 0.0279,
                "Maximum stoichiometry": 0.9014,
                "Maximum concentration [mol.m-3]": 33133,
                "Particle radius [m]": 5.86e-06,
                "Surface area per unit volume [m-1]": 383959,
                "Diffusivity [m2.s-1]": 3.3e-14,
                "OCP [V]": "1.9793 * exp(-39.3631 * x) + 0.2482 - 0.0909 * tanh(29.8538 * "
                "(x - 0.1234)) - 0.04478 * tanh(14.9159 * (x - 0.2769)) - 0.0205 * "
                "tanh(30.4444 * (x - 0.6103))",
                "Entropic change coefficient [V.K-1]": "(-0.1112 * x + 0.02914 + 0.3561 * "
                "exp(-((x - 0.08309) ** 2) / 0.004616)) / 1000",
                "Reaction rate constant [mol.m-2.s-1]": 6.48e-07,
            },
            "Positive electrode": {
                "Thickness [m]": 7.56e-05,
                "Minimum stoichiometry": 0.2661,
                "Maximum stoichiometry": 0.9084,
                "Maximum concentration [mol.m-3]": 63104,
                "Particle radius [m]": 5.22e-06,
                "Surface area per unit volume [m-1]": 382184,
                "Diffusivity [m2.s-1]": 4e-15,
                "OCP [V]": "-0.8090 * x + 4.4875 - 0.0428 * tanh(18.5138 * (x - 0.5542)) - "
                "17.7326 * tanh(15.7890 * (x - 0.3117)) + 17.5842 * tanh(15.9308 * (x - 0.3120))",
                "Entropic change coefficient [V.K-1]": {
                    "x": _X,
                    "y": [positive_entropy_V_per_K(x) for x in _X],
                },
                "Reaction rate constant [mol.m-2.s-1]": 3.42e-06,
            },
            "User-defined": {"Thermal conductivity [W.m-1.K-1]": 0.8},
        },
        "State": {
            "Initial conditions": {"Initial temperature [K]": 296.0},
            "Thermal environment": {"Heat transfer coefficient [W.m-2.K-1]": 20.0},
        },
    }


def written(folder: Path, content: Any) -> Path:
    """The content as a file."""
    path = folder / "cell.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path
