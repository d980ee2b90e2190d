"""Runs what is left of a campaign on a workforce, and stores each piece as it is finished."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool

from bms.errors import BmsError
from hil_sim.run.workforce import Workforce
from hil_sim.studies.campaign.settings import CampaignSettings
from hil_sim.studies.campaign.store import CampaignFolder
from hil_sim.studies.campaign.worker import run_chunk

Progress = Callable[[int], None]
FINISHING_S = 0.4
"""Less than bms.interruption leaves the workers."""


def run_campaign(
    settings: CampaignSettings,
    folder: CampaignFolder,
    workforce: Workforce,
    progress: Progress = lambda runs: None,
) -> int:
    """Run everything that the folder lacks; return the number of runs done now.

    At an interrupt, pieces that finish within FINISHING_S are stored too, and then it passes on.
    Raises BmsError when a worker dies.
    """
    left = iter(folder.unfinished())
    pending: dict[Future[str], range] = {}
    done_runs = 0

    def collect(finished: set[Future[str]]) -> int:
        runs = 0
        for future in finished:
            chunk = pending.pop(future)
            folder.store(chunk, future.result())
            progress(len(chunk))
            runs += len(chunk)
        return runs

    try:
        while True:
            while len(pending) < workforce.pieces_at_hand and (chunk := next(left, None)):
                pending[workforce.executor.submit(run_chunk, settings, chunk)] = chunk
            if not pending:
                return done_runs
            done_runs += collect(wait(pending, return_when=FIRST_COMPLETED).done)
    except KeyboardInterrupt:
        for future in list(pending):
            if future.cancel():
                del pending[future]
        collect(wait(pending, FINISHING_S).done)
        raise
    except (BrokenProcessPool, CancelledError):
        raise BmsError(
            f"{folder.path}: a worker was lost; finished runs are kept, go on with --resume"
        ) from None
