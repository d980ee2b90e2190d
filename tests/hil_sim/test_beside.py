"""Several charges beside each other, as `make run` shows them: names, files, table, page."""

import json
import re
import shlex
import subprocess
from html.parser import HTMLParser

import pytest

from bms.presets import DEFAULT_PRESET
from bms.presets.optimum import KNOWN_BOUNDS
from bms.presets.schema import Initial
from hil_sim.bus.catalog import Mode
from hil_sim.commands.baselines import Baseline, baseline_settings
from hil_sim.report.chart import CONTROLLER_COLOURS
from hil_sim.report.figures import figures, has_bound
from hil_sim.run.session import run_both
from hil_sim.run.settings import ControllerKind, Settings
from tests.docs.pages import ROOT
from tests.hil_sim.command_line import bms

RUNS = ["kan-rcbf-fastest", "s-cbf", "kan-rcbf-fixed"]
BOUND = json.loads(KNOWN_BOUNDS.read_text())["presets"][DEFAULT_PRESET]


@pytest.fixture(scope="module")
def main_job(tmp_path_factory):
    """What the rule `run` of the Makefile prints, and the folder that it writes."""
    out = tmp_path_factory.mktemp("main_job") / "run"
    rule = subprocess.run(
        ["make", "-n", "run", f"OUT={out}"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    (line,) = [line for line in rule.stdout.splitlines() if "bms sil" in line]
    done = bms(*shlex.split(line)[1:])
    assert done.returncode == 0
    # On a busy machine it says how far it is.
    assert all(re.fullmatch(r"bms: .*, \d+ s", line) for line in done.stderr.splitlines())
    return done.stdout, out


@pytest.fixture(scope="module")
def summary(main_job):
    return json.loads((main_job[1] / "summary.json").read_text())


@pytest.fixture(scope="module")
def charges(summary):
    """Summaries of the three charges by name."""
    return {"kan-rcbf-fastest": summary, **summary["baselines"]}


@pytest.mark.slow
def test_the_main_job_charges_planned_with_the_surface_alone_and_as_the_paper(summary, charges):
    assert list(charges) == RUNS
    said = [(one["controller"], one["mode"]) for one in charges.values()]
    assert said == [("kan-rcbf", "fastest"), ("s-cbf", None), ("kan-rcbf", "fixed")]
    # The key that there was for one baseline still is the S-CBF.
    assert summary["baseline"] == summary["baselines"]["s-cbf"]


@pytest.mark.slow
def test_the_plan_is_safe_sooner_than_all_and_near_the_bound(charges):
    planned, s_cbf, fixed = (charges[name] for name in RUNS)
    assert planned["limits_kept"] and fixed["limits_kept"] and not s_cbf["limits_kept"]
    assert planned["charge_time_s"] < fixed["charge_time_s"] < s_cbf["charge_time_s"]
    assert BOUND["optimum_time_s"] < planned["charge_time_s"] < 1.02 * BOUND["optimum_time_s"]


@pytest.mark.slow
def test_the_planned_charge_is_that_of_a_charger_that_knows_no_modes(charges, preset):
    alone = json.loads(json.dumps(run_both(Settings(preset)).summary.to_json()))
    planned = charges["kan-rcbf-fastest"]
    assert {key for key in alone if alone[key] != planned[key]} <= {"wall_time_s"}


@pytest.mark.slow
def test_the_table_has_the_bound_as_a_column(main_job, charges):
    lines = main_job[0].splitlines()
    (heading,) = [line for line in lines if "bound " in line and "limit" in line]
    assert heading.split() == [*RUNS, "bound", "limit"]
    (times,) = [line for line in lines if line.startswith("Charging time")]
    (ratios,) = [line for line in lines if line.startswith("  over the bound") and "521.0" in line]
    ends = [f"{charges[name]['charge_time_s']:.1f} s" for name in RUNS]
    bound = f"{BOUND['optimum_time_s']:.1f} s"
    assert re.findall(r"\d+\.\d+ s", times) == [*ends, bound]
    assert re.findall(r"\d+\.\d{3}", ratios) == [
        f"{charges[name]['charge_time_s'] / BOUND['optimum_time_s']:.3f}" for name in RUNS
    ]


class Tables(HTMLParser):
    """Texts of the cells of each row, of all tables of a page."""

    def __init__(self):
        super().__init__()
        self.rows = []
        self._is_cell = False

    def handle_starttag(self, tag, attrs):
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")
        self._is_cell = tag in ("td", "th") or (self._is_cell and tag not in ("tr", "table"))

    def handle_data(self, data):
        if self._is_cell:
            self.rows[-1][-1] += data.strip("\n")


@pytest.mark.slow
def test_the_page_has_every_charge_in_one_table_with_the_bound(main_job, charges):
    tables = Tables()
    tables.feed((main_job[1] / "report.html").read_text())
    begin = tables.rows.index(["", *RUNS, "bound", "limit"])
    rows = {row[0]: row[1:] for row in tables.rows[begin + 1 :] if len(row) == len(RUNS) + 3}
    ends = [f"{charges[name]['charge_time_s']:.1f} s" for name in RUNS]
    assert rows["Charging time"] == [*ends, f"{BOUND['optimum_time_s']:.1f} s", ""]
    peaks = [f"{charges[name]['max_core_temperature_K']:.2f} K" for name in RUNS]
    assert rows["Peak core temperature"] == [*peaks, "", "323.00 K"]
    with_ramp = rows["  over the bound with ramp and map"]
    assert with_ramp[-2:] == [f"{BOUND['lower_bound_s']:.1f} s", ""]
    deciding = {row[0] for row in tables.rows[begin:] if len(row) == 3}
    assert set(RUNS) <= deciding


@pytest.mark.slow
@pytest.mark.parametrize("page", ["README.md", "docs/results.md"])
def test_the_pages_have_the_figures_of_the_main_job(charges, page):
    text = (ROOT / page).read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.split("|")] for line in text.splitlines()]
    table = {row[1]: row[2:-1] for row in rows if len(row) > 2}
    columns = [charges[name] for name in ("kan-rcbf-fastest", "kan-rcbf-fixed", "s-cbf")]
    ends = [f"{one['charge_time_s']:.1f} s" for one in columns]
    over = [f"{one['charge_time_s'] / BOUND['optimum_time_s']:.3f}" for one in columns]
    core = [f"{one['max_core_temperature_K']:.2f} K" for one in columns]
    surface = [f"{one['max_surface_temperature_K']:.2f} K" for one in columns]
    assert table["time to full"][:4] == [*ends, f"{BOUND['optimum_time_s']:.1f} s"]
    assert table["time over the bound"][:3] == over
    assert table["peak core temperature"][:3] == core
    assert table["peak surface temperature"][:3] == surface


def test_one_baseline_alone_stands_where_it_stood():
    done = bms("sil", "--baseline", "s-cbf", "--max-time-s", 1, "--json")
    summary = json.loads(done.stdout)
    assert summary["baseline"]["controller"] == "s-cbf"
    assert "baselines" not in summary


def test_a_baseline_that_is_named_twice_is_refused_in_one_line():
    done = bms("sil", "--baseline", "cc-cv", "--baseline", "s-cbf", "--baseline", "cc-cv")
    line = "bms: --baseline cc-cv: is named twice; leave one out"
    assert (done.returncode, done.stdout, done.stderr.splitlines()) == (2, "", [line])


def test_every_controller_can_stand_beside(preset):
    settings = Settings(preset, mode=Mode.BY_TIME, full_by_s=900.0)
    beside = baseline_settings(settings, list(Baseline), "virtual:other")
    assert {one.controller for one in beside} == set(ControllerKind)
    assert {one.bus for one in beside} == {"virtual:other"}
    names = [one.name for one in beside]
    assert names.pop(names.index("kan-rcbf-by-time"))
    assert names == [one.value for one in Baseline if one is not Baseline.KAN_RCBF]
    (fixed,) = [one for one in beside if one.name == "kan-rcbf-fixed"]
    assert (fixed.mode, fixed.full_by_s) == (Mode.FIXED, None)


def test_each_charge_has_a_colour_of_its_own():
    assert len(set(CONTROLLER_COLOURS)) == len(CONTROLLER_COLOURS) >= 1 + len(Baseline)


def test_without_a_known_bound_there_is_no_column_for_it(preset):
    known, unknown = (
        figures(preset.limits, [run_both(Settings(preset, seed=3, max_time_s=1.0, initial=start))])
        for start in (None, Initial(0.5, 300.0, 0.0))
    )
    assert (has_bound(known), has_bound(unknown)) == (True, False)
    assert {line.name for line in unknown} < {line.name for line in known}
