"""`bms fault-matrix --cells`: the faults of a pack as rows, judged as those of a cell are."""

from __future__ import annotations

import json
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from bms.model.pair import load_pair
from hil_sim.bus.catalog import FirstFault
from hil_sim.commands.fault_matrix import fault_matrix
from hil_sim.pack import fault_matrix as of_pack
from hil_sim.pack.faults import CELL_OFFSET_V, FAULTS, PackFault
from hil_sim.pack.settings import PackChargeSettings

SETTINGS = PackChargeSettings(*load_pair("paper_calibrated", None), 6)


def test_every_fault_of_a_pack_is_a_row_with_its_deadline_from_1_on():
    rows = of_pack.pack_rows()
    assert [row.name for row in rows] == [fault.name for fault in FAULTS]
    for row, fault in zip(rows, FAULTS, strict=True):
        assert row.expect.reaction == "stops"
        assert row.expect.deadline_periods == fault.stop_periods + 1


@pytest.mark.parametrize("cells", [6, 16, 96])
def test_all_rows_are_as_expected(bms, cells):
    code, out, _ = bms("fault-matrix", "--cells", cells, "--jobs", 1, "--json")
    content = json.loads(out)
    assert (code, content["cells"], content["red"]) == (0, cells, 0)
    assert content["rows"] == len(FAULTS)
    for row in content["results"]:
        assert row["passed"] and row["final_state"] == "fault" and row["final_current_A"] == 0.0
        assert row["first_zero_period"] <= row["deadline_periods"], row
        assert row["latched_period"] <= row["latch_deadline_periods"], row
        assert set(row["latched"]) & set(row["latches"].split(" or ")), row


def test_the_reports_have_a_case_for_each_chosen_row(bms, tmp_path):
    out = tmp_path / "out"
    code, text, _ = bms("fault-matrix", "--cells", 8, "--rows", "late", "--jobs", 1, "--out", out)
    assert code == 0 and "all 4 rows as expected" in text
    assert json.loads((out / "fault-matrix.json").read_text())["cells"] == 8
    assert len(ElementTree.parse(out / "junit.xml").findall(".//testcase")) == 4
    assert "coolant a period late" in (out / "fault-matrix.html").read_text()


def nothing(**changes):
    return PackFault("none", 3, (FirstFault.OUT_OF_STEP,), **changes)


def hot(plant, since, kept):
    """The core of a cell is beyond its limit, whatever the ECU does."""
    plant.fields.plant.cell[2].memory.state.core = 400.0


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (nothing(), "A, 3 periods after it began"),
        (nothing(reading=hot), "plant: cell 3: core_temperature_K over its limit by"),
    ],
)
def test_a_fault_that_is_not_met_and_a_limit_that_is_crossed_are_red(
    monkeypatch, capsys, fault, said
):
    monkeypatch.setattr(of_pack, "FAULTS", (fault,))
    assert fault_matrix(cells=6, jobs=1) == 1
    told = " ".join(capsys.readouterr().out.split())
    assert said in told and "1 of 1 rows are red" in told


FAMILY = ("samsung_30q", 16, "thermistor stuck", "a family of cells")
LOOSE = ("samsung_30q", 96, "a cell's voltage off by 0.3 V", "may miss the string's by 0.")


@pytest.mark.parametrize(("preset", "cells", "name", "said"), [FAMILY, LOOSE])
def test_a_fault_that_the_preset_cannot_tell_from_what_is_right_does_not_apply(
    monkeypatch, preset, cells, name, said
):
    """That no limit is crossed is asked all the same; without its excuse the same run is red."""
    settings = PackChargeSettings(*load_pair(preset, None), cells)
    (row,) = (row for row in of_pack.pack_rows() if row.name == name)
    verdict = of_pack.play_row(settings, row)
    assert verdict.failures == ()
    assert said in verdict.does_not_apply
    (fault,) = (fault for fault in FAULTS if fault.name == name)
    monkeypatch.setattr(of_pack, "FAULTS", (replace(fault, excuse=lambda settings: None),))
    verdict = of_pack.play_row(settings, row)
    assert verdict.does_not_apply is None
    assert "periods after it began" in verdict.failures[0]


def test_no_row_of_the_default_preset_needs_an_excuse():
    settings = PackChargeSettings(*load_pair("paper_calibrated", None), 96)
    assert [fault.name for fault in FAULTS if fault.excuse(settings)] == []


@pytest.mark.parametrize("off_V", [-0.01, 0.01])
def test_the_sum_of_the_cells_tells_a_wrong_one_by_more_than_all_errors_together(off_V):
    """From both sides: so many cells that the errors are just below, and just above the offset."""
    preset, model = load_pair("samsung_30q", None)
    (fault,) = (one for one in FAULTS if one.name == f"a cell's voltage off by {CELL_OFFSET_V:g} V")
    known_V = [PackChargeSettings(preset, model, n).pack_voltage_error_V for n in range(1, 193)]
    cells = next(n for n, error_V in enumerate(known_V, 1) if error_V >= CELL_OFFSET_V)
    settings = PackChargeSettings(preset, model, cells if off_V > 0.0 else cells - 1)
    assert (fault.excuse(settings) is not None) == (off_V > 0.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--cells", 5), "at least that many"),
        (("--cells", 193), "from 1 to 192"),
        (("--cells", 16, "--rows", "nonsense"), "no row has such a name"),
        (("--cells", 16, "--matrix", "mine.toml"), "--matrix: is for one cell"),
        (("--cells", 16, "--preset", "lin2014"), "alpha2"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(bms, options, said):
    code, out, err = bms("fault-matrix", *options)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert said in err


def test_several_processes_give_the_verdicts_of_one():
    rows = [row for row in of_pack.pack_rows() if "corrupted" in row.name]
    alone, together = (of_pack.play_rows(SETTINGS, rows, jobs) for jobs in (1, 2))
    assert [v.first_zero_period for v in alone] == [v.first_zero_period for v in together]
    assert [v.max_voltage_V for v in alone] == [v.max_voltage_V for v in together]
