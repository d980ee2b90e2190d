"""`bms dashboard` in a process of its own, and a browser without a screen that opens its page.

    python -m tests.hil_sim.dashboard_page

draws docs/images/browser.png, browser-fault.png, browser-limits.png and browser-pack.png.
To run again after the page has changed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from hil_sim.dashboard.build import STATIC

CHROMIUM = shutil.which("chromium")
PICTURES = Path(__file__).parents[2] / "docs" / "images"
PATIENCE_MS = 30_000
SIZE = {"width": 1280, "height": 800}
_ALONE = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
needs_page = pytest.mark.skipif(
    not STATIC.is_dir() and "CI" not in os.environ, reason="not run: the page is not built"
)
needs_browser = pytest.mark.skipif(
    (CHROMIUM is None or not STATIC.is_dir()) and "CI" not in os.environ,
    reason="not run: chromium is not installed, or the page is not built",
)


@contextmanager
def dashboard(*arguments: object) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Address of the page, and the process that serves it; it has to end as it should."""
    # python-can imports asammdf where it is, which takes seconds here and is not needed.
    program = 'import sys; sys.modules["asammdf"] = None; from bms.cli import main; main()'
    words = map(str, ("dashboard", "--port", 0, *arguments))
    process = subprocess.Popen(
        [sys.executable, "-c", program, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("http://127.0.0.1:"), process.communicate()
        yield line.split()[0], process
        process.terminate()
        _, said = process.communicate(timeout=10.0)
        assert (process.returncode, said) == (0, "")
    finally:
        process.kill()


@contextmanager
def as_files(folder: Path) -> Iterator[str]:
    """Address of a folder that a plain file server hands out on loopback."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()
            thread.join()


@contextmanager
def browser() -> Iterator[Any]:
    """Chromium, driven by Playwright."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 (where it is skipped)

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=list(_ALONE))
        try:
            yield started
        finally:
            started.close()


def wait_for_end(page: Any, run: int = 1) -> None:
    """Return when the charge of that number since the page was loaded is complete."""
    page.wait_for_selector(f'body[data-run="{run}"][data-end="complete"]', timeout=PATIENCE_MS)


def set_speed(page: Any, name: str) -> None:
    page.select_option("#speed", label=name)


def inject(page: Any, name: str) -> None:
    """Press the button of a fault, whose first variant is chosen."""
    page.fill("#find", name)
    page.get_by_role("button", name=name, exact=True).click()


def saved(page: Any, folder: Path, name: str) -> Path:
    """A file as the page hands it out."""
    with page.expect_download() as download:
        page.get_by_role("button", name=f"Save {name}").click()
    assert download.value.suggested_filename == name
    path = folder / name
    download.value.save_as(path)
    return path


def saved_log(page: Any, folder: Path) -> Path:
    """can.log as the page hands it out."""
    return saved(page, folder, "can.log")


def apply_limits(page: Any, **limits: float) -> None:
    """Ask for limits by their keys in a preset."""
    for key, value in limits.items():
        page.fill(f"#{key}", str(value))
    page.get_by_role("button", name="Apply limits").click()


def draw_charge(page: Any, path: Path) -> None:
    """The page while a limit takes current away, with S-CBF beside the charge."""
    page.check("#beside")
    page.get_by_role("button", name="Charge anew").click()
    # On a machine that is too busy to see the one, the other.
    again = 'body[data-run="2"]'
    page.wait_for_selector(f'{again} #state[data-state="derated"], {again}[data-end="complete"]')
    page.get_by_role("button", name="Pause").click()
    page.wait_for_timeout(300)
    page.screenshot(path=path)


def draw_fault(page: Any, path: Path) -> None:
    """The part of the page where faults are injected, after one of them."""
    page.check("#as-matrix")
    inject(page, "charger supplies more than commanded")
    page.wait_for_selector(".verdict.passed")
    page.fill("#find", "")
    page.locator("#matrix").screenshot(path=path)


def draw_limits(page: Any, path: Path) -> None:
    """The controls, with limits tighter than the preset's."""
    apply_limits(page, max_core_temperature_K=318, max_voltage_V=3.5)
    page.get_by_role("button", name="Save preset.toml").wait_for()
    page.locator("#limits").screenshot(path=path)


def draw_pack_page(page: Any, path: Path) -> None:
    """The page of a pack while one of its cells takes current away."""
    page.select_option("#speed", label="100 times")
    page.get_by_role("button", name="Charge anew").click()
    page.locator("#governs", has_text="governs, by its core").wait_for()
    page.focus('#heat button[data-governs="true"]')
    page.select_option("#speed", label="real time")
    page.wait_for_timeout(300)
    page.screenshot(path=path)


def main() -> None:
    """Draw the pictures of the documentation."""
    with dashboard() as (address, _), browser() as started:
        page = started.new_page(viewport=SIZE, color_scheme="light")
        page.goto(address)
        page.wait_for_selector("#rows li")
        draw_charge(page, PICTURES / "browser.png")
        draw_fault(page, PICTURES / "browser-fault.png")
        draw_limits(page, PICTURES / "browser-limits.png")
        page.goto(f"{address}pack.html")
        page.set_viewport_size({"width": 1100, "height": 480})
        page.wait_for_selector("#heat button")
        draw_pack_page(page, PICTURES / "browser-pack.png")


if __name__ == "__main__":
    main()
