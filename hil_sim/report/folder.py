"""An output folder whose files appear whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from bms.errors import InputError


class OutputFolder:
    """Files are written to a temporary folder inside and moved to their names by `commit`.

    Entering raises InputError when the folder cannot be made or written. Leaving without commit
    leaves no trace, not even the folder and its parents when they were new; what the system
    refuses to write meanwhile becomes InputError too. `option` is what the user can change then.
    """

    def __init__(self, folder: Path, option: str = "--out") -> None:
        self._folder = folder
        self._option = option
        self._temporary = folder
        self._made: list[Path] = []

    def path(self, name: str) -> Path:
        """Where to write a file of that name before `commit`."""
        return self._temporary / name

    def commit(self) -> None:
        """Move every file to its final name, replacing an older one.

        Raises InputError, with nothing moved, when a folder stands where a file has to go.
        """
        moves = [(file, self._folder / file.name) for file in sorted(self._temporary.iterdir())]
        for _, target in moves:
            if target.is_dir():
                raise InputError(f"{target}: is a folder; choose another {self._option}")
        for file, target in moves:
            file.replace(target)
        self._made = []

    def __enter__(self) -> OutputFolder:
        wanted = (self._folder, *self._folder.parents)
        self._made = [folder for folder in wanted if not folder.exists()]
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._temporary = Path(tempfile.mkdtemp(prefix=".writing-", dir=self._folder))
        except OSError as error:
            self._remove_made()
            raise self._refusal(error) from None
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        shutil.rmtree(self._temporary, ignore_errors=True)
        self._remove_made()
        if isinstance(error, OSError):  # such as a disk that is full
            raise self._refusal(error) from None

    def _remove_made(self) -> None:
        for folder in self._made:
            # Another process may have put something there meanwhile.
            with suppress(OSError):
                folder.rmdir()

    def _refusal(self, error: OSError) -> InputError:
        return InputError(
            f"{self._folder}: cannot be written ({error.strerror or error}); "
            f"choose another {self._option}"
        )
