"""What changes from one preset to another, and what has to be made anew for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from bms.presets.digest import plain
from bms.presets.schema import Preset

_OF_PEOPLE = {"name", "description", "sources"}
_ABSENT = object()
_DERIVED = {
    "reference_current_A": ("limits.reference_current_A",),
    "sampling_period_s": ("timing.sampling_period_s",),
    "core_limit_of_bound_K": (
        "limits.max_core_temperature_K", "operating_box.surface_temperature_K",
    ),
}  # fmt: skip
"""Keys of the training content that have another name than in the preset."""


@dataclass(frozen=True)
class Difference:
    """A key with its value in either preset, None where it is absent, and what an edit needs.

    A new model needs a new certificate, and either needs new tables in the firmware. The hash of
    the whole preset is in the tables, so that each edit needs at least them.
    """

    key: str
    first: Any
    second: Any
    needs_training: bool
    needs_certificate: bool

    @property
    def needs(self) -> tuple[str, ...]:
        """What has to be made anew, in the order in which it is made."""
        return (
            *(("training",) if self.needs_training else ()),
            *(("certificate",) if self.needs_certificate else ()),
            "tables",
        )


def differences(first: Preset, second: Preset) -> list[Difference]:
    """Each key that differs, in the order of the file."""
    one, other = flattened(first), flattened(second)
    of_training = _training_keys(first, second)
    keys = [*one, *(key for key in other if key not in one)]
    return [
        Difference(key, one.get(key), other.get(key), key in of_training, key not in _OF_PEOPLE)
        for key in keys
        if one.get(key, _ABSENT) != other.get(key, _ABSENT)
    ]


def flattened(preset: Preset) -> dict[str, Any]:
    """Values by dotted path: numbers, texts and lists; what has its default is left out."""
    return dict(_leaves(plain(preset), ""))


def _leaves(content: Any, path: str) -> Iterator[tuple[str, Any]]:
    if isinstance(content, dict):
        for name, value in content.items():
            yield from _leaves(value, f"{path}.{name}".strip("."))
    elif content is not None:
        yield path, content


def _training_keys(first: Preset, second: Preset) -> set[str]:
    """Keys whose difference makes a model of one preset stale for the other."""
    one = dict(_leaves(plain(first.training_content()), ""))
    other = dict(_leaves(plain(second.training_content()), ""))
    changed = {
        key for key in one.keys() | other.keys() if one.get(key, _ABSENT) != other.get(key, _ABSENT)
    }
    return {name for key in changed for name in _DERIVED.get(key, (key,))}
