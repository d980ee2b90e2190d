"""The tables of docs/results.md have the figures of the kept results of the long checks."""

import pytest

from tests.docs.pages import ROOT
from tools.long_checks import load_checks

PAGE = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
SAID = {check.name: (check.result() or {}).get("said") for check in load_checks()}


@pytest.mark.parametrize("preset", ["paper_calibrated", "lin2014"])
@pytest.mark.parametrize(
    ("cells", "name"), [("inside", "within"), ("outside", "published intervals")]
)
def test_the_campaign_of_the_page_is_the_kept_one(preset, cells, name):
    result = SAID[f"campaign-{preset}"]["classes"][cells]
    crossed = [
        result["controllers"][controller]["violations"]["any"]["count"]
        for controller in ("kan-rcbf", "s-cbf", "cc-cv")
    ]
    cells_of_row = [f"{preset}, {name}", result["runs"], *crossed]
    assert f"| {' | '.join(map(str, cells_of_row))} |" in PAGE


def test_the_ends_of_the_campaign_on_the_page_are_the_kept_ones():
    ends = {"time-limit": 0, "fault": 0}
    for preset in ("paper_calibrated", "lin2014"):
        for cells in SAID[f"campaign-{preset}"]["classes"].values():
            outcomes = cells["controllers"]["kan-rcbf"]["outcomes"]
            ends = {end: count + outcomes.get(end, 0) for end, count in ends.items()}
    text = " ".join(PAGE.split())
    assert f"Of the KAN-rCBF charges, {ends['time-limit']} (hot start" in text
    assert f"and {ends['fault']} ended in a fault" in text


def test_the_three_places_of_the_page_are_the_kept_ones():
    scenarios = SAID["three-places"]["scenarios"]
    frames = sum(scenario["frames"] for scenario in scenarios)
    assert f"{len(scenarios)} runs, {frames:,} frames" in PAGE
