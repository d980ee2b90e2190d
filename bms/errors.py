"""The errors that a user can cause or has to act on; the command line prints them as one line."""

from __future__ import annotations

from collections.abc import Iterable


class BmsError(Exception):
    """Base of every error of this project that a user can act on."""


class InputError(BmsError, ValueError):
    """A file, option or value that cannot be used; the message says what, where and the remedy."""


class ManyInputError(InputError):
    """Several complaints about one input, each what, where and remedy; as text, the first."""

    def __init__(self, complaints: tuple[str, ...]) -> None:
        super().__init__(complaints[0])
        self.complaints = complaints


def refuse(complaints: Iterable[str]) -> None:
    """Raise ManyInputError of the complaints, if there are any."""
    if found := tuple(complaints):
        raise ManyInputError(found)


class ModelMismatchError(InputError):
    """A model, preset or image that do not belong together."""


class BusError(BmsError):
    """A CAN bus that cannot be opened or does not answer."""


class PlantError(BmsError):
    """A simulated cell whose equations have no solution where the charge has driven it."""
