"""Base of what a with block closes at its end: buses, files, processes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TypeVar

_Self = TypeVar("_Self", bound="Closing")


class Closing(ABC):
    """A context manager that closes itself, whatever happened meanwhile."""

    @abstractmethod
    def close(self) -> None:
        """Release what was opened."""

    def __enter__(self: _Self) -> _Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
