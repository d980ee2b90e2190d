"""A trained estimator with its provenance, and the JSON file that holds it."""

from __future__ import annotations

import hashlib
import json
import math
import shlex
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bms.bounds.record import ErrorBounds
from bms.errors import InputError
from bms.files import write_text
from bms.kan.accuracy import ErrorFigures
from bms.kan.network import Network
from bms.kan.settings import TrainingSettings
from bms.presets import preset_names
from bms.validation import NonNegative, parse, read_json, strict

FORMAT_VERSION = 1
_SHIPPED = Path(__file__).parents[1] / "models"


@strict
@dataclass(frozen=True)
class SplitErrors:
    """Errors on one split, for its constant and dynamic profiles apart when there are such."""

    overall: ErrorFigures
    constant: ErrorFigures | None = None
    dynamic: ErrorFigures | None = None


@strict
@dataclass(frozen=True)
class TrainingRecord:
    """Where a network comes from: settings, data, and number of profiles of each split.

    `data_sha256` is that of the CSV file; None for data simulated from the preset, which the
    training hash and the seed identify.
    """

    settings: TrainingSettings
    data: str
    data_sha256: str | None
    profiles: dict[str, int]


@strict
@dataclass(frozen=True)
class KanModel:
    """A network with its provenance, its errors on each split and its error bound.

    `error_bound_K` (e_max) is the sum of `error_bound_parts_K`, whose "estimate" is the one of
    `error_bounds` that is in use; None there means that they were not derived. `edge_error_bounds`
    bound the firmware's error of every edge, in the unit of its value; empty for a network that the
    firmware cannot hold. `training_hash` is Preset.training_hash at training time, None when
    trained on measurements.
    """

    format_version: int
    network: Network
    preset: str | None
    training_hash: str | None
    training: TrainingRecord
    errors: dict[str, SplitErrors]
    error_bound_K: NonNegative
    error_bound_parts_K: dict[str, NonNegative]
    error_bounds: ErrorBounds | None = None
    edge_error_bounds: tuple[NonNegative, ...] = ()

    def __post_init__(self) -> None:
        if self.format_version != FORMAT_VERSION:
            raise InputError(
                f"format_version: {self.format_version} is not known, only {FORMAT_VERSION}; "
                f"train again with {train_command(self.preset)}"
            )
        if not math.isclose(self.error_bound_K, math.fsum(self.error_bound_parts_K.values())):
            raise InputError("error_bound_K: must be the sum of error_bound_parts_K")
        if self.error_bounds is not None and not math.isclose(
            self.error_bound_parts_K.get("estimate", math.nan), self.error_bounds.used_K
        ):
            raise InputError("error_bound_parts_K.estimate: must be the bound in use")

    @property
    def hash(self) -> str:
        """SHA-256 of the whole content, as hexadecimal text."""
        canonical = json.dumps(asdict(self), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()


def load_model(path: Path) -> KanModel:
    """Model from a JSON file.

    Raises InputError when the file is absent, malformed, of another format or does not have the
    content that its hash stands for.
    """
    content: Any = read_json(path)
    stated = content.pop("hash", None) if isinstance(content, dict) else None
    if isinstance(content, dict) and "error_bound_K" in content and "error_bounds" not in content:
        raise InputError(
            f"{path}: error_bounds: missing, the file is older than this version of bms; "
            f"train the model again with {train_command(content.get('preset'))}"
        )
    model = parse(KanModel, content, str(path))
    if stated != model.hash:
        raise InputError(
            f"{path}: hash: does not fit the content, the file is stale or edited; "
            f"write it anew with {train_command(model.preset)}"
        )
    return model


def save_model(model: KanModel, path: Path) -> None:
    """Write the model as JSON, at once or not at all; InputError when the folder cannot be used."""
    write_text(path, json.dumps({"hash": model.hash, **asdict(model)}, indent=1) + "\n")


def shipped_model_path(preset_name: str, lagged: bool = False) -> Path:
    """Path of the model that ships for a preset; the lagged one sees the past, too."""
    return _SHIPPED / f"{preset_name}{'_lagged' if lagged else ''}.json"


def shipped_models() -> list[Path]:
    """Paths of all models that ship, by name."""
    return sorted(_SHIPPED.glob("*.json"))


def train_command(preset_name: str | None, given: str | Path | None = None) -> str:
    """Quoted command that trains a model for a preset, or for measurements when there is none.

    `given` is how the user names the preset: a name that ships or the path of its file.
    """
    if preset_name is None:
        source = "--data CSV"
    elif given is not None:
        source = f"--preset {shlex.quote(str(given))}"
    else:
        source = f"--preset {preset_name if preset_name in preset_names() else 'PRESET.toml'}"
    return f"'bms train {source} --out model.json'"


def load_shipped_model(preset_name: str, given: str | Path | None = None) -> KanModel:
    """The model that ships for a preset, `given` as in train_command; InputError without one."""
    path = shipped_model_path(preset_name)
    if not path.is_file():
        raise InputError(
            f"preset '{preset_name}': no model ships for it; train one with "
            f"{train_command(preset_name, given)} and give it as --model model.json"
        )
    return load_model(path)
