"""The page of a pack in Chromium: the engine of `bms pack`, and its cells as a heat map."""

import numpy as np
import pytest

from bms.model.pair import load_pair
from hil_sim.dashboard.pack_scenario import pack_charge
from hil_sim.studies.pack.engine import play
from hil_sim.studies.pack.settings import PackSettings
from tests.hil_sim.dashboard_page import (
    PATIENCE_MS,
    SIZE,
    browser,
    dashboard,
    draw_pack_page,
    needs_browser,
    set_speed,
)

pytestmark = [needs_browser, pytest.mark.slow]


@pytest.fixture(scope="module")
def address():
    with dashboard() as (address, _):
        yield f"{address}pack.html"


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture
def page(chromium, address):
    page = chromium.new_page(viewport=SIZE)
    complaints = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(address)
    page.wait_for_selector("#heat button")
    yield page
    assert complaints == []
    page.close()


@pytest.mark.parametrize("cells", [1, 16])
def test_a_pack_charges_as_in_the_engine_of_bms_pack(page, cells):
    preset, model = load_pair("paper_calibrated", None)
    charge, _ = pack_charge(PackSettings(preset, model, cells=cells))
    play([charge], cells, np.random.default_rng(np.random.SeedSequence(0).spawn(2)[1]))
    set_speed(page, "as fast as it goes")
    page.select_option("#cells", str(cells))
    page.wait_for_selector('body[data-run="2"][data-end="complete"]', timeout=PATIENCE_MS)
    tiles = page.locator("#heat button")
    peaks = [float(tiles.nth(i).get_attribute("data-peak")) for i in range(tiles.count())]
    assert charge.outcome == "complete"
    assert float(page.get_attribute("body", "data-time")) == pytest.approx(charge.fields.time_s)
    assert peaks == pytest.approx(charge.peaks()[:, 1].tolist(), abs=1e-9)
    assert max(peaks) <= preset.limits.max_core_temperature_K


def test_cells_are_told_apart_without_colour_and_by_the_keyboard(page):
    set_speed(page, "as fast as it goes")
    page.wait_for_selector('body[data-end="complete"]', timeout=PATIENCE_MS)
    page.focus("#restart")
    page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    assert page.inner_text("#detail").startswith("Cell 2: core 3")
    tiles = page.locator("#heat button")
    assert "cell 16" in tiles.nth(15).inner_text() and " K" in tiles.nth(15).inner_text()
    page.select_option("#shown", "voltage_V")
    assert tiles.first.inner_text().endswith(" V")
    assert "3.600 V, the limit" in page.inner_text("#legend")
    page.select_option("#shown", "soc")
    assert tiles.first.inner_text().endswith(" %")
    assert "no log to save" in page.inner_text("#pack")


def test_the_cell_and_the_constraint_that_govern_are_named_and_drawn(page, tmp_path):
    draw_pack_page(page, tmp_path / "pack.png")
    assert (tmp_path / "pack.png").stat().st_size > 0
    said = page.inner_text("#governs")
    cell = page.locator('#heat button[data-governs="true"] span').inner_text()
    assert f"{cell} governs, by its " in said
