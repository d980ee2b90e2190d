"""`bms optimum` as a user calls it."""

import json
import re
import sys

import pytest

from bms.presets import load_preset
from bms.presets.optimum import known_bound

FEW = ("--preset", "lin2014", "--start", 313, "--soc", 0.8, "--samples", 30)


def test_both_bounds_their_profiles_and_a_chart(bms, tmp_path):
    pytest.importorskip("cvxpy")
    code, out, _ = bms("optimum", *FEW, "--out", tmp_path / "new", "--json")
    assert code == 0
    result = json.loads(out)
    assert json.loads((tmp_path / "new" / "optimum.json").read_text()) == result
    assert (tmp_path / "new" / "optimum.png").read_bytes().startswith(b"\x89PNG")
    assert (result["preset"], result["temperature_K"], result["soc"]) == ("lin2014", 313.0, 0.8)
    physics, ramped = result["bounds"]
    assert result["optimum_time_s"] == physics["time_s"] < ramped["time_s"]
    assert result["lower_bound_s"] == ramped["time_s"]
    capacity_As = load_preset("lin2014").cell.capacity_As
    for bound in (physics, ramped):
        assert bound["time_s"] < bound["reached_s"] <= bound["constant_then_riding_s"]
        ends_s, current_A = bound["profile"]["end_s"], bound["profile"]["current_A"]
        assert len(ends_s) == len(current_A) == bound["samples"] == 30
        charged = -sum(current_A) * ends_s[-1] / 30 / capacity_As
        assert charged == pytest.approx(result["full_soc"] - 0.8, abs=5e-3)
    assert min(ramped["profile"]["current_A"][:1]) > min(physics["profile"]["current_A"][:1])


def test_the_table_says_what_is_proven_and_what_was_played(bms):
    pytest.importorskip("cvxpy")
    code, out, _ = bms("optimum", "--soc", 0.9, "--samples", 20, "--no-ramp")
    assert code == 0
    assert "physics alone" in out
    assert "with ramp" not in out
    (row,) = (line for line in out.splitlines() if line.startswith("physics alone "))
    bound_s, slack_s, *played = re.findall(r"\d+\.\d", row)
    assert float(bound_s) < float(played[0])
    assert float(slack_s) < 0.1 * float(bound_s)


def test_without_the_solver_one_line_names_the_extra(bms, monkeypatch):
    monkeypatch.setitem(sys.modules, "cvxpy", None)
    code, out, err = bms("optimum", *FEW)
    assert (code, out) == (2, "")
    assert err == "bms: optimum: cvxpy is not installed; pip install 'kan-rcbf-bms[bench]'\n"


def test_a_known_bound_needs_no_solver(monkeypatch):
    monkeypatch.setitem(sys.modules, "cvxpy", None)
    assert known_bound(load_preset("lin2014")) is not None


def test_a_start_that_is_full_is_refused_in_one_line(bms):
    code, _, err = bms("optimum", "--preset", "lin2014", "--soc", 1)
    assert code == 2
    assert err.count("\n") == 1
    assert "state of charge 1 at the start" in err


def test_a_charge_that_nobody_can_finish_is_told_as_that(bms):
    pytest.importorskip("cvxpy")
    code, _, err = bms(
        "optimum", "--preset", "paper_calibrated", "--start", 322.9, "--cooling", 0,
        "--no-ramp", "--samples", 20,
    )  # fmt: skip
    assert code == 2
    assert "no controller fills the cell within 36000 s" in err
