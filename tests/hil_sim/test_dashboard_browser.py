"""The page in Chromium: a charge, its log, faults, the keyboard, and a bus that is watched."""

import re
import subprocess
import sys
import time
from urllib.parse import urlsplit

import pytest

from hil_sim.bus.catalog import Mode
from hil_sim.logs.recorder import Recorder
from hil_sim.run.session import run_both
from hil_sim.run.settings import ControllerKind, Settings
from tests.hil_sim.dashboard_page import (
    SIZE,
    browser,
    dashboard,
    draw_charge,
    draw_fault,
    inject,
    needs_browser,
    saved_log,
    set_speed,
    wait_for_end,
)
from tests.hil_sim.slcan_hub import FRAMES, SlcanHub

pytestmark = [needs_browser, pytest.mark.slow]

FULL_S = 10.0
LONGEST_GAP_MS = 500.0
PNG = b"\x89PNG"
FOCUSED = "document.activeElement.id || document.activeElement.textContent"
CONTROLS = (
    "restart pause speed save beside mode reference cooling "
    "preset soc temperature resistance capacity seed find as-matrix"
)
NAMELESS = """[...document.querySelectorAll("input, select, button")]
  .filter((one) => !one.labels?.length && !one.getAttribute("aria-label"))
  .filter((one) => one.textContent.trim() === "")
  .map((one) => one.id)"""
WATCH_GAPS = """() => {
  let last = performance.now();
  window.longest = 0;
  setInterval(() => {
    const now = performance.now();
    window.longest = Math.max(window.longest, now - last);
    last = now;
  }, 10);
}"""


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def address():
    with dashboard() as (address, _):
        yield address


@pytest.fixture
def page(chromium, address):
    """The page with all of its rows; whatever it fetches or complains of is seen."""
    context = chromium.new_context(viewport=SIZE)
    page = context.new_page()
    fetched, complaints = [], []
    page.on("request", lambda request: fetched.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(address)
    page.wait_for_selector("#rows li")
    yield page
    own = urlsplit(address).netloc
    assert {urlsplit(url).netloc for url in fetched if not url.startswith(("data:", "blob:"))} == {
        own
    }
    assert complaints == []
    context.close()


def logged(preset, path, **settings):
    with Recorder(path) as recorder:
        run_both(Settings(preset, bus="virtual:page", **settings), recorder)
    return path.read_bytes()


def test_it_is_full_ten_seconds_after_loading_and_answers_all_the_while(chromium, address):
    page = chromium.new_page(viewport=SIZE)
    begin_s = time.monotonic()
    page.goto(address)
    page.evaluate(WATCH_GAPS)
    set_speed(page, "as fast as it goes")
    wait_for_end(page)
    took_s = time.monotonic() - begin_s
    assert page.inner_text("#state") == "complete"
    assert "99.0 %" in page.inner_text("#readings")
    assert "every one kept" in page.inner_text("#faults")
    assert page.evaluate("window.longest") < LONGEST_GAP_MS
    assert took_s < FULL_S
    page.close()


def test_the_saved_log_is_that_of_bms_sil_and_replays_identically(page, preset, tmp_path, bms):
    set_speed(page, "as fast as it goes")
    wait_for_end(page)
    log = saved_log(page, tmp_path)
    assert log.read_bytes() == logged(preset, tmp_path / "sil.log", mode=Mode.FASTEST)
    code, out, err = bms("replay", log)
    assert code == 0, out + err


def test_seed_mode_and_start_are_those_of_bms_sil(page, preset, tmp_path):
    page.fill("#seed", "7")
    page.select_option("#mode", "by-time")
    page.locator("#full-by").fill("900")
    set_speed(page, "as fast as it goes")
    page.get_by_role("button", name="Charge anew").click()
    wait_for_end(page, run=2)
    expected = logged(preset, tmp_path / "sil.log", seed=7, mode=Mode.BY_TIME, full_by_s=900.0)
    assert saved_log(page, tmp_path).read_bytes() == expected


def test_s_cbf_beside_it_is_that_of_bms_sil_whenever_it_is_switched_on(page, preset):
    summary = run_both(Settings(preset, ControllerKind.S_CBF, bus="virtual:page")).summary
    minutes, seconds = divmod(int(summary.charge_time_s), 60)
    expected = (
        f"full after {minutes} min {seconds:02d} s, "
        f"core up to {summary.max_core_temperature_K:.2f} K"
    )
    set_speed(page, "as fast as it goes")
    wait_for_end(page)
    page.check("#beside")  # behind the charge, which it then has to catch up with
    page.locator("#decision", has_text=expected).wait_for()
    page.get_by_role("button", name="Charge anew").click()
    wait_for_end(page, run=2)
    page.locator("#decision", has_text=expected).wait_for()


@pytest.mark.parametrize(
    "name", ["lost for good", "sensor wire broken", "charger supplies more than commanded"]
)
def test_a_fault_that_is_injected_meets_its_row_of_the_matrix(page, tmp_path, name, bms):
    set_speed(page, "as fast as it goes")
    page.check("#as-matrix")
    inject(page, name)
    verdict = page.locator(".verdict.passed")
    verdict.wait_for()
    should, did = verdict.locator("p").all_inner_texts()[:2]
    assert should.startswith("should 0 A within ")
    assert did.startswith("did 0 A in period ")
    code, out, err = bms("replay", saved_log(page, tmp_path))
    assert code == 0, out + err


def test_everything_is_within_the_window_and_within_reach_of_the_keyboard(page):
    set_speed(page, "as fast as it goes")
    wait_for_end(page)
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") == width
    page.evaluate("document.activeElement.blur()")
    reached = set()
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.add(page.evaluate(FOCUSED))
    assert set(CONTROLS.split()) <= reached
    assert "lost once" in reached
    page.focus("#restart")
    page.keyboard.press("Enter")
    page.wait_for_selector('body[data-run="2"]')
    page.focus("#pause")
    page.keyboard.press("Space")
    assert page.inner_text("#pause") == "Go on"
    names = page.evaluate(NAMELESS)
    assert names == []


def test_the_pictures_of_the_documentation_can_be_drawn(page, tmp_path):
    draw_charge(page, tmp_path / "charge.png")
    draw_fault(page, tmp_path / "fault.png")
    assert (tmp_path / "charge.png").read_bytes().startswith(PNG)
    assert (tmp_path / "fault.png").read_bytes().startswith(PNG)
    assert "S-CBF" in page.inner_text("#charts")


def started(*words):
    program = 'import sys; sys.modules["asammdf"] = None; from bms.cli import main; main()'
    return subprocess.Popen(
        [sys.executable, "-c", program, *map(str, words)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def test_a_bus_with_bms_plant_and_bms_ecu_is_shown_until_it_is_lost(chromium):
    with SlcanHub() as hub, dashboard("--bus", hub.bus) as (address, process):
        page = chromium.new_page(viewport=SIZE)
        page.goto(address)
        page.get_by_text("waiting for frames").wait_for()
        others = [
            started("ecu", "--bus", hub.bus, "--silence-s", 30),
            started("plant", "--bus", hub.bus, "--answer-timeout-s", 30),
        ]
        try:
            page.locator("#state", has_text="charging").wait_for()
            assert hub.bus in page.inner_text("#source")
            assert "323 K" in page.inner_text("#readings")
            assert re.search(r"Core, estimated\s+28\d\.\d\d K", page.inner_text("#readings"))
            assert page.locator("#controls").is_hidden()
            hub.send(b"t10060000000000FF")  # no CRC of this message
            hub.send(b"T000001001AB")  # nobody's
            page.locator("#traffic tr.bad", has_text="CellElectrical").wait_for()
            page.get_by_text("1 of them foreign").wait_for()
            told = hub.commands[0]
        finally:
            for other in others:
                other.kill()
                other.wait()
        page.get_by_text("the bus has been silent").wait_for()
        assert not [command for command in told if command[:1] in FRAMES]
        hub.drop()
        page.locator("#message", has_text=hub.bus).wait_for()
        assert page.inner_text("#state") == "no feed"
        assert process.poll() is None
        page.close()
