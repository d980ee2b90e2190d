"""Where the files of a run go: the folder of --out, and the recording of --log."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from hil_sim.logs import usable_format
from hil_sim.logs.recorder import Recorder
from hil_sim.report.folder import OutputFolder


@dataclass(frozen=True)
class Outputs:
    """Folders that are written, and what records the bus into them; None where not asked for."""

    folder: OutputFolder | None
    log_folder: OutputFolder | None
    paths: tuple[Path, ...]

    @contextmanager
    def recorder(self) -> Iterator[Recorder | None]:
        """Records while entered: can.log in the folder, and the log of its own."""
        if not self.paths:
            yield None
            return
        with Recorder(*self.paths) as recorder:
            yield recorder

    def commit(self) -> None:
        """Give all files their names."""
        for folder in (self.folder, self.log_folder):
            if folder is not None:
                folder.commit()


@contextmanager
def outputs(out: Path | None, log: Path | None) -> Iterator[Outputs]:
    """Folders for the files of a run, which are gone again without a commit.

    Raises InputError when one cannot be written, or the log's suffix names no format.
    """
    with ExitStack() as stack:
        folder = stack.enter_context(OutputFolder(out)) if out is not None else None
        log_folder = None
        paths = [folder.path("can.log")] if folder is not None else []
        if log is not None:
            usable_format(log)
            log_folder = stack.enter_context(OutputFolder(log.parent, "--log"))
            paths.append(log_folder.path(log.name))
        yield Outputs(folder, log_folder, tuple(paths))
