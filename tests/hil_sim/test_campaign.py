"""A campaign: the same bytes whoever runs it, nothing lost or repeated, violations counted."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from bms.cell import CellState, rates
from bms.errors import InputError
from bms.model.model_file import load_shipped_model
from bms.presets import load_preset
from bms.presets.schema import Initial
from hil_sim.bus.catalog import Mode
from hil_sim.commands import campaign as command
from hil_sim.plant.true_cell import nominal_cell
from hil_sim.run.workforce import (
    InlineExecutor,
    Workforce,
    dask_workforce,
    local_workforce,
)
from hil_sim.studies.campaign.engine import SUB_STEPS, CampaignCharge, Scenario
from hil_sim.studies.campaign.rows import header
from hil_sim.studies.campaign.run import run_campaign
from hil_sim.studies.campaign.settings import CHUNK_RUNS, CampaignSettings
from hil_sim.studies.campaign.store import CampaignFolder
from hil_sim.studies.campaign.summary import column, firmware_is_safe, summarise
from hil_sim.studies.campaign.worker import run_chunk
from tests.hil_sim.command_line import bms

PRESET = "paper_calibrated"
ALONE = Workforce(InlineExecutor(), 1)
TWO_KELVIN_MORE = {"max_core_temperature_K": 325.0}


def settings_of(runs, name=PRESET, **changes):
    return CampaignSettings(load_preset(name), load_shipped_model(name), runs, **changes)


SHORT = partial(settings_of, 2 * CHUNK_RUNS + 5, max_time_s=20.0)


def run_all(path, settings, workforce=ALONE, resume=False):
    folder = CampaignFolder(path, settings, resume)
    done = run_campaign(settings, folder, workforce)
    folder.finish()
    return done, (path / "runs.csv").read_bytes()


@pytest.fixture(scope="module")
def expected():
    settings = SHORT()
    return (header(settings.family) + run_chunk(settings, range(settings.runs))).encode()


def test_processes_change_nothing(tmp_path, expected):
    with local_workforce(2) as workforce:
        assert run_all(tmp_path / "two", SHORT(), workforce) == (SHORT().runs, expected)
    with local_workforce(1) as workforce:
        assert run_all(tmp_path / "one", SHORT(), workforce) == (SHORT().runs, expected)


def test_a_dask_cluster_changes_nothing(tmp_path, expected):
    distributed = pytest.importorskip("distributed", reason="not run: dask is not installed")
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        dask_workforce(cluster.scheduler_address) as workforce,
    ):
        assert run_all(tmp_path / "c", SHORT(), workforce) == (SHORT().runs, expected)


def test_another_seed_gives_other_cells(expected):
    assert run_chunk(SHORT(seed=1), range(3)) not in expected.decode()


class InterruptedAfter(InlineExecutor):
    def __init__(self, pieces):
        self._pieces = pieces

    def submit(self, fn, /, *args, **kwargs):
        if self._pieces == 0:
            raise KeyboardInterrupt
        self._pieces -= 1
        return super().submit(fn, *args, **kwargs)


def test_a_resumed_campaign_loses_and_repeats_nothing(tmp_path, expected):
    with pytest.raises(KeyboardInterrupt):
        run_all(tmp_path, SHORT(), Workforce(InterruptedAfter(1), 1))
    assert not (tmp_path / "runs.csv").exists()
    assert run_all(tmp_path, SHORT(), resume=True) == (SHORT().runs - CHUNK_RUNS, expected)
    assert run_all(tmp_path, SHORT(), resume=True) == (0, expected)


INTERRUPTIBLE = """
import signal
from bms.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored under a shell's &
main()
"""


def test_an_interrupt_from_the_keyboard_keeps_whole_pieces(tmp_path):
    arguments = ["campaign", "--runs", "4000", "--jobs", "2", "--max-time-s", "100"]
    arguments += ["--out", str(tmp_path)]
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTIBLE, *arguments],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while process.poll() is None and not list(tmp_path.glob("chunks/0*.csv")):
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "--resume" in errors
    pieces = sorted(tmp_path.glob("chunks/0*.csv"))
    settings = settings_of(4000, max_time_s=100.0)
    folder = CampaignFolder(tmp_path, settings, resume=True)
    assert 0 < len(pieces) == len(settings.chunks()) - len(folder.unfinished())
    first = int(pieces[0].stem)
    assert pieces[0].read_text() == run_chunk(settings, range(first, first + CHUNK_RUNS))
    assert all(piece.read_text().count("\n") == CHUNK_RUNS for piece in pieces)


def test_a_mode_is_asked_for_by_name_and_a_time_cannot_be(tmp_path):
    times_s = {}
    for mode in ("fixed", "fastest"):
        bms("campaign", "--runs", 1, "--mode", mode, "--out", tmp_path / mode)
        (row,) = CampaignFolder(
            tmp_path / mode, settings_of(1, mode=Mode[mode.upper()]), True
        ).rows()
        times_s[mode] = float(row["kan_rcbf_charge_time_s"])
    assert times_s["fastest"] < times_s["fixed"]
    refused = bms("campaign", "--mode", "by-time", "--out", tmp_path / "none")
    assert (refused.returncode, "choose fastest or fixed" in refused.stderr) == (2, True)
    assert not (tmp_path / "none").exists()


def test_only_the_same_campaign_is_resumed(tmp_path):
    with pytest.raises(InputError, match="holds no campaign"):
        CampaignFolder(tmp_path, SHORT(), resume=True)
    CampaignFolder(tmp_path, SHORT(), resume=False)
    with pytest.raises(InputError, match="--resume"):
        CampaignFolder(tmp_path, SHORT(), resume=False)
    with pytest.raises(InputError, match="seed"):
        CampaignFolder(tmp_path, SHORT(seed=1), resume=True)
    CampaignFolder(tmp_path, SHORT(), resume=True)


def outcome_of(tmp_path, settings):
    folder = CampaignFolder(tmp_path, settings, resume=False)
    run_campaign(settings, folder, ALONE)
    folder.finish()
    return folder.rows(), summarise(settings, folder.rows())


def test_full_charges_are_safe_and_the_baselines_are_not(tmp_path):
    rows, summary = outcome_of(tmp_path, settings_of(16))
    inside = summary["classes"]["inside"]
    assert firmware_is_safe(summary)
    assert inside["runs"] == inside["by_family"]["within"] == 8
    assert summary["classes"]["outside"]["by_family"] == {"published": 8}
    assert inside["controllers"]["s-cbf"]["violations"]["core"]["count"] > 0
    assert inside["controllers"]["cc-cv"]["violations"]["core"]["count"] > 0
    assert inside["controllers"]["kan-rcbf"]["outcomes"]["complete"] >= 6
    limit_K = load_preset(PRESET).limits.max_core_temperature_K
    expected = sum(
        float(row["s_cbf_max_core_temperature_K"]) > limit_K for row in rows if row["inside"] == "1"
    )
    assert inside["controllers"]["s-cbf"]["violations"]["core"]["count"] == expected


def test_a_core_limit_raised_by_2_K_is_caught(tmp_path):
    _, summary = outcome_of(tmp_path, settings_of(8, firmware_changes=TWO_KELVIN_MORE))
    assert not firmware_is_safe(summary)
    violations = summary["classes"]["inside"]["controllers"]["kan-rcbf"]["violations"]
    assert violations["core"]["count"] == violations["any"]["count"] > 0
    assert violations["voltage"]["count"] == violations["soc"]["count"] == 0


@pytest.mark.parametrize(("changes", "code"), [({}, 0), (TWO_KELVIN_MORE, 1)])
def test_the_exit_code_tells(tmp_path, monkeypatch, capsys, changes, code):
    broken = partial(CampaignSettings, firmware_changes=changes)
    monkeypatch.setattr(command, "CampaignSettings", broken)
    assert command.campaign(runs=8, jobs=1, out=tmp_path, as_json=True) == code
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "summary.json").read_text())
    assert printed["runs_in_this_session"] == 8
    assert (tmp_path / "histograms.png").read_bytes().startswith(b"\x89PNG")


def test_bounds_are_those_of_clopper_and_pearson(tmp_path):
    rows, summary = outcome_of(tmp_path, settings_of(10, max_time_s=1.0))
    assert len(rows) == 10
    none = summary["classes"]["inside"]["controllers"]["kan-rcbf"]["violations"]["any"]
    runs = summary["classes"]["inside"]["runs"]
    assert (none["count"], none["low"]) == (0, 0.0)
    assert none["high"] == pytest.approx(1.0 - 0.025 ** (1.0 / runs))


def test_the_model_error_is_that_of_the_cell_model(tmp_path):
    """Rates of the drawn cell less those of the nominal one, by the Python model."""
    settings = settings_of(1)
    preset = settings.preset
    cell = preset.cell.__class__(
        **vars(preset.cell)
        | {"core_heat_capacity_J_per_K": 1.05 * preset.cell.core_heat_capacity_J_per_K}
    )
    start = nominal_cell(preset, Initial(0.1, 300.0, 0.5))
    other = replace(start, cell=cell)
    charge = CampaignCharge(Scenario(settings), "kan-rcbf", other, np.zeros(4), True)
    worst = np.zeros(4)
    periods = 600
    for _ in range(periods):
        charge.advance(np.zeros((1, 5)), np.zeros((SUB_STEPS, 4)))
        now = charge.fields.memory.state
        state = CellState(now.soc, now.core, now.surface, now.coolant)
        true, nominal = (
            np.array(rates(some, state, charge.fields.current_A, 0.5))
            for some in (cell, preset.cell)
        )
        worst = np.maximum(worst, np.abs(true - nominal))
    error = charge.fields.peaks.model_error
    assert (error.soc, error.surface, error.coolant) == (0.0, 0.0, 0.0)
    assert error.core == pytest.approx(worst[1], rel=0.01)
    assert error.core > preset.uncertainty.core_K_per_s


@pytest.mark.parametrize("family", ["within", "published"])
def test_inside_means_within_every_bound(expected, family):
    lines = [line.split(",") for line in expected.decode().splitlines()]
    rows = [dict(zip(lines[0], line)) for line in lines[1:]]
    bounds = load_preset(PRESET).uncertainty
    inside = (
        (column(rows, "core_model_error_K_per_s") <= bounds.core_K_per_s)
        & (column(rows, "surface_model_error_K_per_s") <= bounds.surface_K_per_s)
        & (column(rows, "coolant_model_error_K_per_s") <= bounds.coolant_K_per_s)
        & (column(rows, "surface_model_error_slope_K_per_s2") <= bounds.surface_rate_K_per_s2)
    )
    cell = load_preset(PRESET).cell
    core_W = column(rows, "core_heat_capacity_J_per_K") * bounds.core_K_per_s
    rest_W = cell.surface_heat_capacity_J_per_K * bounds.surface_K_per_s
    rest_W += cell.coolant_heat_capacity_J_per_K * bounds.coolant_K_per_s
    is_cooled = column(rows, "cooling_power_W") >= core_W + rest_W
    assert 0 < is_cooled.sum() < is_cooled.size
    assert np.array_equal(inside & is_cooled, column(rows, "inside") == 1.0)
    of_family = np.array([row["family"] == family for row in rows])
    assert of_family.any()
    if family == "within":
        assert inside[of_family].all()
