"""Tables of docs/benchmarks.md and docs/cost.md: of the kept run, and of the accepted sizes."""

import json

import pytest

from tools.benchmark_page import (
    BENCHMARKS,
    COST,
    KEPT,
    benchmark_tables,
    cost_tables,
    pages,
    with_tables,
)

SAID = json.loads(KEPT.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", [BENCHMARKS, COST], ids=lambda path: path.name)
def test_the_page_has_the_tables_of_the_figures(path):
    assert path.read_text(encoding="utf-8") == pages()[path], "run python -m tools.benchmark_page"


def test_the_kept_run_has_every_aim_and_every_missed_one_has_its_parts():
    aims = {aim["name"]: aim for aim in SAID["aims"]}
    for row in (
        "estimate and decision, worst of a charge on mps2-an386",
        "control period with frames, median on mps2-an386",
        "control period with frames in C",
        "campaign, runs a second and core",
        "simulation on virtual:bench, one process",
        "simulation on socketcan:vcan0, one process in a guest",
        "simulation on socketcan:vcan0, two processes in a guest",
        "flash of the application on mps2-an386",
        "flash of the application on mps2-an385",
        "flash of the image on mps2-an386",
    ):
        assert row in aims
    parts = {one["figure"]: one for one in SAID["breakdowns"]}
    solvers = ("over C", "estimate plus decision in C")
    for name, aim in aims.items():
        if not aim["is_reached"] and not name.endswith(solvers):
            assert sum(parts[name]["parts"].values()) == pytest.approx(parts[name]["measured"])
            assert parts[name]["limit"].lower() in PAGE_TEXT


PAGE_TEXT = BENCHMARKS.read_text(encoding="utf-8").lower().replace("µs", "us")


def test_a_table_without_its_place_is_refused():
    page = "<!-- a -->\nold\n<!-- end of a -->\n"
    assert with_tables(page, {"a": "new"}) == "<!-- a -->\n\nnew\n\n<!-- end of a -->\n"
    with pytest.raises(ValueError, match="no single place for the table 'b'"):
        with_tables(page, {"b": "new"})


def test_figures_are_shown_as_they_were_measured():
    tables = benchmark_tables(SAID)
    assert f"load average at the start {SAID['machine']['load_average']:g}" in tables["machine"]
    for row in SAID["campaign"]:
        assert f"| {row['runs']:,} | {row['runs_per_s']:.1f} |" in tables["campaign"]
    assert "family of cells" in cost_tables()["flash"]
