"""Small networks and recordings that several test modules start from."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from bms.data.measurements import COLUMNS
from bms.kan.network import INPUT_NAMES, Edge, Network


def random_network(width=(4, 3, 1), grid=2, degree=3, seed=0):
    """Network with random weights; hidden grids are too narrow for some inputs of the box."""
    rng = np.random.default_rng(seed)

    def edge(half):
        inner = np.sort(rng.uniform(-half, half, grid - 1))
        outside = half + 0.5 * np.arange(1, degree + 1)
        knots = np.concatenate([-outside[::-1], [-half], inner, [half], outside])
        return Edge(
            tuple(knots.tolist()),
            float(rng.normal()),
            float(rng.normal()),
            tuple(rng.normal(size=grid + degree).tolist()),
        )

    layers = tuple(
        tuple(tuple(edge(1.0 if n == 0 else 1.5) for _ in range(inputs)) for _ in range(outputs))
        for n, (inputs, outputs) in enumerate(pairwise(width))
    )
    return Network(
        degree,
        INPUT_NAMES,
        (-12.0, 1.0, 300.0, 295.0),
        (12.0, 1.0, 20.0, 15.0),
        305.0,
        25.0,
        layers,
    )


def write_recording(path: Path, rows=300, **columns):
    """CSV recording of a made-up charge; `columns` replace or add values (one for each row)."""
    time_s = np.arange(rows, dtype=float)
    current_A = -10.0 + 8.0 * np.sin(time_s / 17.0)
    surface_K = 300.0 + 5.0 * np.sin(time_s / 40.0)
    values = {
        "time_s": time_s,
        "current_A": current_A,
        "cooling_power_W": np.zeros(rows),
        "surface_temperature_K": surface_K,
        "coolant_temperature_K": 297.0 + np.cos(time_s / 55.0),
        "core_temperature_K": surface_K + 0.01 * current_A**2,
        **columns,
    }
    assert set(COLUMNS) <= set(values)
    lines = [",".join(values)]
    lines += [",".join(map(str, row)) for row in zip(*values.values())]
    path.write_text("\n".join(lines) + "\n")
    return path
