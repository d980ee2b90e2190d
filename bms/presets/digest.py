"""Hashes of nested dataclasses that stay the same when a field with a default is added."""

from __future__ import annotations

import hashlib
import json
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any


def digest(content: Any) -> str:
    """SHA-256 of dataclasses, mappings, sequences and plain values, as hexadecimal text.

    A field that has its default is left out, so that a field which comes later, and is not used,
    changes no hash.
    """
    return hashlib.sha256(json.dumps(plain(content), sort_keys=True).encode()).hexdigest()


def plain(content: Any) -> Any:
    """The content as mappings and lists, without fields that have their default."""
    if is_dataclass(content) and not isinstance(content, type):
        values = {field.name: (field, getattr(content, field.name)) for field in fields(content)}
        return {
            name: plain(value)
            for name, (field, value) in values.items()
            if not _is_default(field, value)
        }
    if isinstance(content, dict):
        return {name: plain(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [plain(value) for value in content]
    return content


def _is_default(field: Field[Any], value: Any) -> bool:
    if field.default_factory is not MISSING:
        return bool(value == field.default_factory())
    return field.default is not MISSING and bool(value == field.default)
