"""The page in Chromium: a charge, its log, faults, the keyboard, and a bus that is watched."""

import base64
import re
import struct
import subprocess
import sys
import time
from urllib.parse import urlsplit

import pytest

from bms.presets import load_preset
from hil_sim.bus.catalog import Mode
from hil_sim.dashboard.site import write_site
from hil_sim.logs.recorder import Recorder
from hil_sim.run.session import run_both
from hil_sim.run.settings import ControllerKind, Settings
from tests.hil_sim.dashboard_page import (
    SIZE,
    apply_limits,
    as_files,
    browser,
    dashboard,
    draw_charge,
    draw_fault,
    draw_limits,
    inject,
    needs_browser,
    saved,
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
    "max_voltage_V max_core_temperature_K max_surface_temperature_K max_soc completion_soc "
    "apply-limits own-limits preset soc temperature resistance capacity seed find as-matrix"
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


def test_a_tightened_limit_is_kept_in_the_frames_of_bms_sil_with_that_preset(
    page, preset, tmp_path, bms
):
    set_speed(page, "as fast as it goes")
    apply_limits(page, max_core_temperature_K=318, max_voltage_V=3.5)
    wait_for_end(page, run=2)
    assert "every one kept" in page.inner_text("#faults")
    assert "318 K" in page.inner_text("#readings")
    path = saved(page, tmp_path, "preset.toml")
    tight = load_preset(path)
    assert (tight.limits.max_core_temperature_K, tight.limits.max_voltage_V) == (318.0, 3.5)
    log = saved_log(page, tmp_path)
    assert log.read_bytes() == logged(tight, tmp_path / "sil.log", mode=Mode.FASTEST)
    summary = run_both(Settings(tight, bus="virtual:page", mode=Mode.FASTEST)).summary
    before = run_both(Settings(preset, bus="virtual:page", mode=Mode.FASTEST)).summary
    assert summary.max_core_temperature_K <= 318.0 < before.max_core_temperature_K
    assert summary.max_voltage_V <= 3.5 < before.max_voltage_V
    assert bms("replay", log)[0] == 2  # the ECU names a preset that does not ship
    for command in (("replay", log, "--preset", path), ("verify", "--preset", path)):
        code, out, err = bms(*command)
        assert code == 0, out + err


def test_a_limit_that_is_refused_leaves_the_one_in_force(page):
    set_speed(page, "as fast as it goes")
    wait_for_end(page)
    apply_limits(page, max_core_temperature_K=324)
    message = page.locator("#message")
    message.get_by_text("324 is looser than the preset's 323").wait_for()
    apply_limits(page, max_core_temperature_K=320, completion_soc=0.98, max_soc=0.5)
    message.get_by_text("completion_soc").wait_for()
    assert page.get_attribute("body", "data-run") == "1"
    assert "323 K" in page.inner_text("#readings")
    assert page.locator("#save-preset").is_hidden()


def test_as_files_without_a_server_a_limit_is_lowered_in_the_steps_there_are(
    chromium, tmp_path, monkeypatch
):
    monkeypatch.setattr("hil_sim.dashboard.page_data.preset_names", list)
    write_site(tmp_path / "site")
    with as_files(tmp_path / "site") as address:
        page = chromium.new_page(viewport=SIZE)
        page.goto(address)
        page.wait_for_selector("#rows li")
        assert "Core temperature, K 321 or 318" in page.inner_text("#limits-note")
        set_speed(page, "as fast as it goes")
        wait_for_end(page)
        message = page.locator("#message")
        apply_limits(page, max_core_temperature_K=319)
        message.get_by_text("these files have 321 or 318, not '319'").wait_for()
        apply_limits(page, max_core_temperature_K=318, max_voltage_V=3.58)
        message.get_by_text("one tighter limit at a time").wait_for()
        apply_limits(page, max_core_temperature_K=323, max_voltage_V=3.6, max_soc=0.995)
        message.get_by_text("limits.max_soc: these files have only the preset's").wait_for()
        apply_limits(page, max_core_temperature_K=318, max_soc=1)
        wait_for_end(page, run=2)
        tight = load_preset(saved(page, tmp_path, "preset.toml"))
        assert tight.limits.max_core_temperature_K == 318.0
        log = saved_log(page, tmp_path)
        assert log.read_bytes() == logged(tight, tmp_path / "sil.log", mode=Mode.FASTEST)
        page.close()


def test_a_calibration_that_the_firmware_refuses_leaves_the_one_in_force(page, preset, tmp_path):
    def spoil(route):
        answer = route.fetch()
        made = answer.json()
        block = bytearray(base64.b64decode(made["preset"]["scenario"]))
        at = block.index(struct.pack("<f", 3.45))  # the limit of the voltage, in float32
        block[at : at + 4] = struct.pack("<f", float("nan"))
        made["preset"]["scenario"] = base64.b64encode(block).decode()
        route.fulfill(response=answer, json=made)

    set_speed(page, "as fast as it goes")
    wait_for_end(page)
    page.route("**/limits/*", spoil)
    apply_limits(page, max_voltage_V=3.45)
    page.locator("#message", has_text="the firmware refuses this calibration").wait_for()
    assert page.get_attribute("body", "data-run") == "1"
    page.get_by_role("button", name="Charge anew").click()
    wait_for_end(page, run=2)
    expected = logged(preset, tmp_path / "sil.log", mode=Mode.FASTEST)
    assert saved_log(page, tmp_path).read_bytes() == expected


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
    for _ in range(50):
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
    draw_limits(page, tmp_path / "limits.png")
    assert (tmp_path / "charge.png").read_bytes().startswith(PNG)
    assert (tmp_path / "fault.png").read_bytes().startswith(PNG)
    assert (tmp_path / "limits.png").read_bytes().startswith(PNG)
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
        points = int(page.get_attribute("#charts", "data-points"))
        hub.drop()
        page.locator("#message", has_text=f"{hub.bus}").get_by_text("connecting again").wait_for()
        page.get_by_text("the bus has been silent").wait_for()
        hub.send(b"T000001001AB")
        page.get_by_text("2 of them foreign").wait_for()
        assert int(page.get_attribute("#charts", "data-points")) > points
        assert process.poll() is None
        page.close()


def test_a_server_that_was_lost_is_found_again_and_the_plots_go_on(chromium):
    with SlcanHub() as hub:
        with dashboard("--bus", hub.bus) as (address, _):
            page = chromium.new_page(viewport=SIZE)
            page.goto(address)
            page.get_by_text("waiting for frames").wait_for()
            hub.send(b"T000001001AB")
            page.get_by_text("1 of them foreign").wait_for()
            page.wait_for_timeout(2000)
        lost = page.locator("#message", has_text="the server of the page is not there")
        waits = []
        for wait in ("1 s", "2 s", "4 s"):
            lost.get_by_text(f"connecting again in {wait}").wait_for()
            waits.append(time.monotonic())
        assert page.inner_text("#state") == "no feed"
        page_points = int(page.get_attribute("#charts", "data-points"))
        assert page_points > 5
        with dashboard("--bus", hub.bus, "--port", urlsplit(address).port):
            page.get_by_text("waiting for frames").wait_for()
            hub.send(b"T000001001AB")
            page.get_by_text("1 of them foreign").wait_for()
            assert int(page.get_attribute("#charts", "data-points")) > page_points
            assert page.inner_text("#state") != "no feed"
            page.close()
    assert waits[2] - waits[1] > 1.5 > waits[1] - waits[0] > 0.5
