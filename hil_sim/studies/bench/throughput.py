"""Charges a second of a Monte Carlo campaign, and whether large campaigns cost more a charge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from bms.model.pair import load_pair
from hil_sim.run.workforce import local_workforce
from hil_sim.studies.bench.race import ClockNs
from hil_sim.studies.campaign.run import run_campaign
from hil_sim.studies.campaign.settings import CampaignSettings
from hil_sim.studies.campaign.store import CampaignFolder

_NS_PER_S = 1e9


@dataclass(frozen=True)
class Throughput:
    """A campaign of that many runs, each with three controllers."""

    runs: int
    jobs: int
    wall_time_s: float
    runs_per_s: float


def campaign_throughput(preset: str, runs: int, jobs: int, clock_ns: ClockNs) -> Throughput:
    """Run a campaign once, with the start of its processes and the writing of runs.csv."""
    settings = CampaignSettings(*load_pair(preset, None), runs=runs)
    with TemporaryDirectory() as folder:
        begin_ns = clock_ns()
        with local_workforce(jobs) as force:
            store = CampaignFolder(Path(folder) / "campaign", settings, resume=False)
            run_campaign(settings, store, force)
        store.finish()
        wall_time_s = (clock_ns() - begin_ns) / _NS_PER_S
    return Throughput(runs, jobs, wall_time_s, runs / wall_time_s)


def growth(campaigns: Sequence[Throughput]) -> list[float]:
    """Time a run of each campaign, relative to that of the first."""
    return [campaigns[0].runs_per_s / campaign.runs_per_s for campaign in campaigns]
