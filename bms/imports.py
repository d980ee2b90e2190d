"""Imports without what a library would load beside it, for seconds, and nobody asked for."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def left_out(name: str) -> Iterator[None]:
    """Within it, a module that has not been loaded yet counts as not installed."""
    if name in sys.modules:
        yield
        return
    sys.modules[name] = None  # type: ignore[assignment] # what import takes for "there is none"
    try:
        yield
    finally:
        del sys.modules[name]
