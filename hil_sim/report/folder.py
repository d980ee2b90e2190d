"""An output folder whose files appear whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from types import TracebackType

from bms.errors import InputError


class OutputFolder:
    """Files are written to a temporary folder inside and moved to their names by `commit`.

    Entering raises InputError when the folder cannot be made or written. Leaving without commit
    leaves no trace, not even the folder when it was new.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._temporary = folder
        self._is_new = False

    def path(self, name: str) -> Path:
        """Where to write a file of that name before `commit`."""
        return self._temporary / name

    def commit(self) -> None:
        """Move every file to its final name, replacing an older one."""
        for file in sorted(self._temporary.iterdir()):
            file.replace(self._folder / file.name)
        self._is_new = False

    def __enter__(self) -> OutputFolder:
        self._is_new = not self._folder.exists()
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._temporary = Path(tempfile.mkdtemp(prefix=".writing-", dir=self._folder))
        except OSError as error:
            raise InputError(
                f"{self._folder}: cannot be written ({error.strerror}); choose another --out"
            ) from None
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        shutil.rmtree(self._temporary, ignore_errors=True)
        if self._is_new:
            self._folder.rmdir()
