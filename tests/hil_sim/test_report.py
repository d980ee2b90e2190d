"""The output folder: whole files or none, a page that needs nothing but itself, true figures."""

import base64
import errno
import json
import os
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from bms.errors import InputError
from hil_sim.report.figures import figures, seconds_by_constraint
from hil_sim.report.files import report_page, summary_json, write_report
from hil_sim.report.folder import OutputFolder
from hil_sim.run.session import run_both
from hil_sim.run.settings import ControllerKind, Settings

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def settings(preset):
    return Settings(preset, max_time_s=250.0)


@pytest.fixture(scope="module")
def results(settings):
    kinds = (ControllerKind.KAN_RCBF, ControllerKind.S_CBF)
    return [run_both(replace(settings, controller=kind)) for kind in kinds]


@pytest.fixture(scope="module")
def written(settings, results, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "deep" / "run"
    with OutputFolder(path) as folder:
        write_report(folder, settings, results)
        folder.commit()
    return path


def test_the_folder_holds_the_files_and_nothing_temporary(written):
    assert sorted(file.name for file in written.iterdir()) == [
        "charge.png",
        "report.html",
        "summary.json",
    ]


def test_a_run_that_fails_leaves_no_trace(tmp_path):
    with pytest.raises(RuntimeError), OutputFolder(tmp_path / "new") as folder:
        folder.path("half.txt").write_text("half")
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_fails_leaves_older_results_as_they_were(tmp_path):
    (tmp_path / "summary.json").write_text("old")
    with pytest.raises(RuntimeError), OutputFolder(tmp_path) as folder:
        folder.path("summary.json").write_text("new")
        raise RuntimeError
    assert [file.name for file in tmp_path.iterdir()] == ["summary.json"]
    assert (tmp_path / "summary.json").read_text() == "old"


def test_parents_that_were_made_for_a_failed_run_go_too(tmp_path):
    (tmp_path / "there").mkdir()
    with pytest.raises(RuntimeError), OutputFolder(tmp_path / "there" / "new" / "run"):
        raise RuntimeError
    assert list(tmp_path.rglob("*")) == [tmp_path / "there"]


def test_a_folder_in_the_place_of_a_file_is_refused_before_anything_is_replaced(tmp_path):
    (tmp_path / "can.log").write_text("old")
    (tmp_path / "summary.json").mkdir()
    with pytest.raises(InputError, match=r"summary\.json"), OutputFolder(tmp_path) as folder:
        for name in ("can.log", "summary.json"):
            folder.path(name).write_text("new")
        folder.commit()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["can.log", "summary.json"]
    assert (tmp_path / "can.log").read_text() == "old"


def test_a_disk_that_fills_up_is_one_line_about_the_folder(tmp_path):
    with pytest.raises(InputError, match="No space left"), OutputFolder(tmp_path / "run"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_refused_on_entering(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="--out"), OutputFolder(tmp_path / "file" / "run"):
        pass


def test_summary_json_has_the_figures_of_both_runs(written, results):
    content = json.loads((written / "summary.json").read_text())
    assert content == summary_json(results)
    assert content["controller"] == "kan-rcbf"
    assert content["baseline"]["controller"] == "s-cbf"
    assert content["steps"] == results[0].summary.steps


class References(HTMLParser):
    """Collects every address that a page refers to."""

    def __init__(self):
        super().__init__()
        self.addresses = []

    def handle_starttag(self, tag, attrs):
        self.addresses += [
            value for name, value in attrs if name in ("src", "href", "srcset", "data")
        ]


def test_the_page_is_self_contained(written):
    page = (written / "report.html").read_text()
    parser = References()
    parser.feed(page)
    images = [base64.b64decode(x.removeprefix("data:image/png;base64,")) for x in parser.addresses]
    assert len(images) == 2
    assert all(image.startswith(PNG) for image in images)
    assert images[0] == (written / "charge.png").read_bytes()
    assert not re.search(r"https?://|@import|url\(", page)


def test_the_page_shows_every_figure_with_its_limit(written, results, preset):
    page = (written / "report.html").read_text()
    for line in figures(preset.limits, results):
        assert line.name in page
        assert all(text in page for text in (*line.values, line.limit))
    assert preset.hash in page
    assert "Every limit kept" in page


def test_a_failed_check_is_the_headline(settings, results):
    page = report_page(settings, results[1:], PNG)
    assert "Check failed: core temperature" in page
    assert "Every limit kept" not in page


def test_figures_mark_exactly_the_limits_that_were_crossed(preset, results):
    marked = {line.name: line.kept for line in figures(preset.limits, results)}
    assert marked["Peak core temperature"] == [True, False]
    assert marked["Peak voltage"] == [True, True]
    assert marked["Charging time"] == [None, None]


def test_times_by_constraint_add_up_to_the_charge(preset, results):
    period_s = preset.timing.sampling_period_s
    for result in results:
        seconds = seconds_by_constraint(result, period_s)
        charging = sum(state in ("charging", "derated") for state in result.series.state)
        assert sum(seconds.values()) == pytest.approx(charging * period_s)


def test_the_chart_repeats_byte_for_byte(settings, results, written, tmp_path):
    with OutputFolder(tmp_path) as folder:
        write_report(folder, settings, results)
        folder.commit()
    for name in ("charge.png", "report.html", "summary.json"):
        assert (tmp_path / name).read_bytes() == (written / name).read_bytes()
