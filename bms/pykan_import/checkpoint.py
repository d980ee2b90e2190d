"""Reading of what pykan's `KAN.saveckpt` writes: configuration, state and last inputs.

Needs PyTorch and PyYAML, but not pykan. Tensors are read without running code of the file.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from bms.arrays import Array
from bms.errors import InputError
from bms.validation import read_text

_PARTS = ("_config.yml", "_state", "_cache_data")
_BASE_FUNCTION = "silu"
_BASE_FUNCTION_AS_OBJECT = "object:torch.nn.modules.activation.SiLU"
"""What pykan's prune_input writes instead of the name."""
_PYTHON_TAG = "tag:yaml.org,2002:python/"
_ZERO_SYMBOL = "0"
_CONSTANT_OF_AFFINE = 3
"""Of a symbolic edge's a, b, c, d: it gives c f(a x + b) + d."""


@dataclass(frozen=True)
class CheckpointLayer:
    """Edges of one layer, input by output: knots (in, G + 1 + 2k), coefficients (in, out, G + k).

    The scales have the shape (in, out); node n gives node_scale[n] * sum + node_shift[n].
    """

    knots: Array
    coefficients: Array
    base_scale: Array
    spline_scale: Array
    node_scale: Array
    node_shift: Array


@dataclass(frozen=True)
class Checkpoint:
    """A network of pykan; `samples` (N, n_in) are the inputs that it saw last, if any.

    `has_pruned_inputs` tells that pykan's prune_input made it; which inputs are left, its input_id,
    is in none of the files.
    """

    name: str
    state_sha256: str
    degree: int
    layers: tuple[CheckpointLayer, ...]
    samples: Array | None
    has_pruned_inputs: bool


def read_checkpoint(path: Path) -> Checkpoint:
    """Checkpoint by the path that saveckpt was given, or by one of the files that it wrote.

    Raises InputError for files that are absent or not pykan's, and for what the firmware's network
    has not: symbolic edges other than '0', multiplication nodes, base functions other than silu,
    layers of different degree.
    """
    prefix = str(path)
    for part in _PARTS:
        prefix = prefix.removesuffix(part)
    config = _config(Path(prefix + _PARTS[0]))
    state_path = Path(prefix + _PARTS[1])
    state = _tensors(state_path)
    where = f"{prefix}_state"
    if not isinstance(state, Mapping):
        raise InputError(f"{where}: holds no state of a network; write it with pykan's saveckpt")
    base_function = config.get("base_fun_name")
    if base_function not in (_BASE_FUNCTION, _BASE_FUNCTION_AS_OBJECT):
        raise InputError(
            f"{prefix}_config.yml: base_fun_name: {base_function!r} on every edge "
            f"is not supported; train with base_fun='{_BASE_FUNCTION}'"
        )
    widths, degree = _widths(config, prefix), _degree(config, prefix)
    try:
        layers = tuple(
            _layer(
                state,
                number,
                _symbolic_constants(state, config, number, prefix)
                if config.get("symbolic_enabled", True)
                else 0.0,
            )
            for number in range(len(widths) - 1)
        )
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{where}: not laid out as pykan 0.2.8 does ({type(error).__name__}: {error}); "
            "write it with that version: pip install pykan==0.2.8, then loadckpt and saveckpt"
        ) from None
    for number, layer in enumerate(layers):
        _check_shapes(
            layer, (widths[number], widths[number + 1]), degree, f"{where}: layer {number}"
        )
    return Checkpoint(
        Path(prefix).name,
        hashlib.sha256(state_path.read_bytes()).hexdigest(),
        degree,
        layers,
        _samples(Path(prefix + _PARTS[2]), widths[0]),
        base_function == _BASE_FUNCTION_AS_OBJECT,
    )


def _config(path: Path) -> dict[str, Any]:
    yaml = _module("yaml")

    class Loader(yaml.SafeLoader):  # type: ignore[misc, name-defined]
        """Takes a Python object for the name of its kind, and makes none."""

    Loader.add_multi_constructor(_PYTHON_TAG, lambda loader, kind, node: kind)
    try:
        content = yaml.load(read_text(path), Loader=Loader)
    except yaml.YAMLError:
        content = None
    if not isinstance(content, dict):
        raise InputError(f"{path}: not a configuration of pykan; write it with saveckpt")
    return content


def _tensors(path: Path) -> Any:
    torch = _module("torch")
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except (OSError, RuntimeError, EOFError, ValueError, KeyError, pickle.UnpicklingError):
        raise InputError(f"{path}: cannot be read as tensors; write it with saveckpt") from None


def _module(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise InputError(
            f"import-pykan: needs the Python package {name}; "
            "install it with: pip install 'kan-rcbf-bms[pykan]'"
        ) from None


def _widths(config: Mapping[str, Any], prefix: str) -> list[int]:
    """Nodes of the inputs and of each layer; multiplication nodes are refused."""
    widths = []
    entries = config.get("width")
    if not isinstance(entries, list) or len(entries) < 2:
        raise InputError(f"{prefix}_config.yml: width: needs inputs and at least one layer")
    for number, entry in enumerate(entries):
        sums, products = entry if isinstance(entry, list) and len(entry) == 2 else (entry, 0)
        if not isinstance(sums, int) or not isinstance(products, int):
            raise InputError(f"{prefix}_config.yml: width: {entry!r} is not a number of nodes")
        if products:
            raise InputError(
                f"{prefix}: layer {number - 1} has {products} multiplication nodes, edges to them "
                "cannot be imported; train a network of sum nodes"
            )
        widths.append(sums)
    return widths


def _degree(config: Mapping[str, Any], prefix: str) -> int:
    given = config.get("k")
    degrees = set(given) if isinstance(given, list) else {given}
    degree = degrees.pop() if len(degrees) == 1 else None
    if not isinstance(degree, int) or degree < 1:
        raise InputError(f"{prefix}_config.yml: k: {given!r} is not one degree of at least 1")
    return degree


def _symbolic_constants(
    state: Mapping[str, Any], config: Mapping[str, Any], number: int, prefix: str
) -> Array:
    """What the symbolic edges add to each node, (out,): '0' a constant; others are refused."""
    active = _array(state[f"symbolic_fun.{number}.mask"])
    names = config[f"symbolic.funs_name.{number}"]
    constants = active * _array(state[f"symbolic_fun.{number}.affine"])[..., _CONSTANT_OF_AFFINE]
    for target, source in np.argwhere(active != 0.0).tolist():
        if names[target][source] != _ZERO_SYMBOL:
            raise InputError(
                f"{prefix}: layer {number}, edge {source} -> {target} is symbolic "
                f"('{names[target][source]}'); call unfix_symbolic({number}, {source}, {target}) "
                "in pykan, train and save again"
            )
    total: Array = np.sum(constants, axis=1)
    return total


def _layer(state: Mapping[str, Any], number: int, constants: Array | float) -> CheckpointLayer:
    part = {
        name: _array(state[f"act_fun.{number}.{name}"])
        for name in ("grid", "coef", "mask", "scale_base", "scale_sp")
    }
    affine = {
        name: _array(state[f"{name}_{number}"])
        for name in ("subnode_scale", "subnode_bias", "node_scale", "node_bias")
    }
    scale = affine["node_scale"] * affine["subnode_scale"]
    shift = affine["node_scale"] * affine["subnode_bias"] + affine["node_bias"]
    return CheckpointLayer(
        part["grid"],
        part["coef"],
        part["mask"] * part["scale_base"],
        part["mask"] * part["scale_sp"],
        scale,
        shift + scale * constants,
    )


def _check_shapes(layer: CheckpointLayer, shape: tuple[int, int], degree: int, where: str) -> None:
    inputs, outputs = shape
    intervals = layer.knots.shape[-1] - 1 - 2 * degree
    expected = {
        "knots": (inputs, intervals + 1 + 2 * degree),
        "coefficients": (inputs, outputs, intervals + degree),
        "base_scale": shape,
        "spline_scale": shape,
        "node_scale": (outputs,),
        "node_shift": (outputs,),
    }
    for name, wanted in expected.items():
        values = getattr(layer, name)
        if intervals < 1 or values.shape != wanted:
            raise InputError(f"{where}: {name} of shape {values.shape}, not {wanted}; save it anew")
        if not np.all(np.isfinite(values)):
            raise InputError(f"{where}: {name} holds a value that is not finite; train it again")
    if not np.all(np.diff(layer.knots) > 0.0):
        source = int(np.argmin(np.diff(layer.knots).min(axis=1)))
        raise InputError(
            f"{where}: edges from node {source} have knots that do not rise; "
            "update the grid from samples that differ, and save again"
        )


def _samples(path: Path, inputs: int) -> Array | None:
    if not path.is_file():
        return None
    content = _tensors(path)
    if content is None:
        return None
    samples = _array(content)
    return samples if samples.ndim == 2 and samples.shape[1] == inputs else None


def _array(tensor: Any) -> Array:
    return np.asarray(tensor.detach().cpu().numpy(), dtype=np.float64)
