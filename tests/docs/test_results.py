"""The tables of docs/results.md have the figures of the kept results of the long checks."""

import pytest

from tests.docs.pages import ROOT
from tools.long_checks import load_checks

PAGE = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
SAID = {check.name: (check.result() or {}).get("said") for check in load_checks()}


@pytest.mark.parametrize("preset", ["paper_calibrated", "lin2014"])
@pytest.mark.parametrize("cells", ["inside", "outside"])
def test_the_campaign_of_the_page_is_the_kept_one(preset, cells):
    result = SAID[f"campaign-{preset}"]["classes"][cells]
    crossed = [
        result["controllers"][controller]["violations"]["any"]["count"]
        for controller in ("kan-rcbf", "s-cbf", "cc-cv")
    ]
    cells_of_row = [f"{preset}, {cells}", result["runs"], *crossed]
    assert f"| {' | '.join(map(str, cells_of_row))} |" in PAGE


def test_the_ends_of_the_campaign_on_the_page_are_the_kept_ones():
    for preset in ("paper_calibrated", "lin2014"):
        classes = SAID[f"campaign-{preset}"]["classes"]
        outcomes = {
            cells: classes[cells]["controllers"]["kan-rcbf"]["outcomes"] for cells in classes
        }
        assert outcomes["inside"] == {"complete": classes["inside"]["runs"]}
        assert "fault" not in outcomes["outside"]
    text = " ".join(PAGE.split())
    assert "All of them were full within an hour; none of the 20,000 ended in a fault" in text


def test_the_family_campaigns_of_the_page_are_the_kept_ones():
    columns = [
        SAID[f"family-{preset}"]["controllers"]["kan-rcbf"]
        for preset in ("a123_26650", "a123_26650_10C")
    ]
    counts = [{kind: v["count"] for kind, v in one["violations"].items()} for one in columns]
    rows = (
        ("core, surface or voltage limit crossed",
         [str(n["core"] + n["surface"] + n["voltage"]) for n in counts]),
        ("true state of charge over 1.005; complete below 0.96",
         [f"{n['soc']}, {n['unfilled']}" for n in counts]),
        ("ended in a fault", [str(n["fault"]) for n in counts]),
        ("complete within three hours, and truly above 99 %",
         [f"{one['complete']['share']:.2%}, {one['full']['share']:.2%}".replace("%", " %")
          for one in columns]),
    )  # fmt: skip
    for said, cells in rows:
        assert f"| {said} | {' | '.join(cells)} |" in PAGE


def test_the_plants_of_the_page_are_the_kept_ones():
    charges = SAID["family-plants"]["charges"]
    assert len(charges) == 12
    for charge in charges:
        assert charge["is_safe"]
        assert charge["stops"] == 0
        resistance = "+6 mohm" if "contact" in charge["plant"] else "new"
        cells = (
            f"{charge['preset']}, {resistance}",
            f"{charge['start_K']:g} K",
            f"{charge['charge_time_s']:.0f} s",
            f"{charge['final_soc']:.3f}",
            f"{charge['core_over_K']:.2f} K",
            f"{charge['surface_over_K']:.2f} K",
            f"{1000 * charge['voltage_over_V']:.1f} mV",
            f"{1000 * charge['min_anode_potential_V']:+.0f} mV",
        )
        assert f"| {' | '.join(cells)} |" in PAGE


def test_the_three_places_of_the_page_are_the_kept_ones():
    scenarios = SAID["three-places"]["scenarios"]
    frames = sum(scenario["frames"] for scenario in scenarios)
    assert f"{len(scenarios)} runs, {frames:,} frames" in PAGE
