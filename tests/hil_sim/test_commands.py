"""`bms sil`, `bms ecu` and `bms plant` as a user calls them."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from bms.model import shipped_model_path
from bms.presets import DEFAULT_PRESET, load_preset, preset_path
from tests.hil_sim.command_line import bms

STABLE_KEYS = [
    "controller",
    "preset",
    "bus",
    "steps",
    "max_core_temperature_K",
    "max_surface_temperature_K",
    "max_voltage_V",
    "final_soc",
    "charge_time_s",
    "first_derate_s",
    "kan_rmse_K",
    "kan_max_abs_error_K",
    "wall_time_s",
]
HAS_VCAN = Path("/sys/class/net/vcan0").exists()


def nearly_full(folder):
    """The default preset with a cell whose charge ends in seconds."""
    preset, text = load_preset(DEFAULT_PRESET), preset_path(DEFAULT_PRESET).read_text()
    soc = f"[initial]\nsoc = {preset.initial.soc:g}"
    assert text.count(soc) == 1
    path = folder / "nearly_full.toml"
    path.write_text(text.replace(soc, f"[initial]\nsoc = {preset.limits.max_soc - 0.01:g}"))
    return path


def test_a_charge_that_becomes_full_is_done(tmp_path):
    done = bms("sil", "--preset", nearly_full(tmp_path), "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["stop_reason"] == "complete"


@pytest.mark.parametrize("options", [("--json",), ()], ids=["json", "table"])
def test_a_charge_whose_time_ends_first_is_not_done_and_says_how_full_it_is(options):
    done = bms("sil", "--max-time-s", 5, *options)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert re.fullmatch(
        r"bms: kan-rcbf-fastest: time ended before the charge: state of charge \d+\.\d\d %; "
        r"see --max-time-s",
        line,
    )


def test_json_is_all_that_is_printed_and_has_the_stable_keys_first():
    done = bms("sil", "--json", "--max-time-s", 5, "--seed", 3)
    assert done.returncode == 1
    summary = json.loads(done.stdout)
    assert list(summary)[: len(STABLE_KEYS)] == STABLE_KEYS
    assert (summary["controller"], summary["bus"]) == ("kan-rcbf", "virtual:bms")
    assert summary["seed"] == 3


def test_a_run_writes_its_four_files_and_a_table(tmp_path):
    done = bms("sil", "--max-time-s", 5, "--out", tmp_path / "run")
    assert done.returncode == 1
    assert sorted(file.name for file in (tmp_path / "run").iterdir()) == [
        "can.log",
        "charge.png",
        "report.html",
        "summary.json",
    ]
    assert "Peak core temperature" in done.stdout
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    lines = (tmp_path / "run" / "can.log").read_text().splitlines()
    assert sum(" 080#" in line for line in lines) == summary["steps"] == 55


def test_the_controller_decides_the_exit_code():
    done = bms("sil", "--controller", "s-cbf", "--max-time-s", 250, "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["violations"]


def test_a_baseline_stands_beside_it_and_does_not():
    done = bms("sil", "--baseline", "s-cbf", "--json")
    assert done.returncode == 0
    summary = json.loads(done.stdout)
    assert summary["limits_kept"] is True
    assert summary["baseline"]["limits_kept"] is False


def test_real_time_takes_its_time():
    done = bms("sil", "--realtime", "--max-time-s", 1, "--json")
    assert done.returncode == 1
    # Fifteen periods; the first needs no waiting.
    assert json.loads(done.stdout)["wall_time_s"] >= 1.4


@pytest.mark.parametrize("command", ["sil", "ecu", "plant"])
def test_help_explains_and_gives_an_example(command):
    done = bms(command, "--help")
    assert done.returncode == 0
    assert f"Example: bms {command}" in done.stdout


no_can = pytest.mark.skipif(HAS_VCAN, reason="this machine has vcan0")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        pytest.param(("sil", "--bus", "socketcan:vcan0"), "virtual:bms", marks=no_can),
        pytest.param(("plant", "--bus", "socketcan:vcan0"), "vcan_guest.sh", marks=no_can),
        pytest.param(("ecu", "--bus", "socketcan:vcan0"), "vcan_guest.sh", marks=no_can),
        (("sil", "--bus", "nonsense:x"), "nonsense"),
        (("sil", "--bus", "vcan0"), "interface:channel"),
        (("plant", "--bus", "virtual:bms"), "bms sil"),
        (("ecu", "--bus", "virtual:bms"), "bms sil"),
        (("sil", "--out", "/proc/not/writable"), "/proc/not/writable"),
        (("sil", "--preset", "unheard-of"), "paper_calibrated"),
        (("ecu", "--bus", "nonsense:x", "--preset", "unheard-of"), "paper_calibrated"),
        (("sil", "--controller", "unheard-of"), "s-cbf"),
        (("sil", "--model", "not-there.json"), "not-there.json"),
        (("sil", "--controller", "s-cbf", "--model", "not-there.json"), "kan-rcbf"),
        (("sil", "--disturbance", "unheard-of"), "bang-bang"),
        (("sil", "--seed", "-1"), "--seed"),
        (("sil", "--max-time-s", "soon"), "--max-time-s"),
        (("plant",), "--bus"),
        (("unheard-of",), "unheard-of"),
    ],
)
def test_wrong_use_is_one_line_on_stderr_and_exit_code_2(arguments, said, tmp_path):
    done = bms(*arguments, folder=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert said in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_preset_with_a_date_for_a_number_is_refused_by_key(tmp_path):
    text = preset_path("lin2014").read_text()
    (tmp_path / "mine.toml").write_text(
        text.replace("capacity_Ah = 2.3", "capacity_Ah = 2026-01-01")
    )
    done = bms("sil", "--preset", tmp_path / "mine.toml")
    assert done.returncode == 2
    assert "cell.capacity_Ah" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_names_with_brackets_are_shown_as_they_are(tmp_path):
    text = preset_path("lin2014").read_text()
    (tmp_path / "mine.toml").write_text(text.replace('name = "lin2014"', 'name = "mine[/bold]"'))
    model, out = shipped_model_path("lin2014"), tmp_path / "[red]"
    done = bms(
        *("sil", "--preset", tmp_path / "mine.toml", "--model", model),
        *("--max-time-s", 1, "--out", out),
    )
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert "mine[/bold]" in done.stdout
    assert str(out / "report.html") in done.stdout


def test_an_unusable_bus_leaves_no_output_folder(tmp_path):
    assert bms("sil", "--bus", "nonsense:x", "--out", tmp_path / "run").returncode == 2
    assert list(tmp_path.iterdir()) == []


def test_the_ecu_starts_without_loading_plots_or_solvers():
    code = "import sys, hil_sim.commands.ecu; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"matplotlib", "scipy", "cantools", "jinja2"} & set(loaded)


def test_a_mode_is_asked_for_and_stands_in_the_summary(tmp_path):
    done = bms("sil", "--preset", nearly_full(tmp_path), "--json", "--mode", "fastest")
    assert (done.returncode, done.stderr) == (0, "")
    assert (json.loads(done.stdout)["mode"], json.loads(done.stdout)["full_by_s"]) == (
        "fastest",
        None,
    )
    done = bms("sil", "--max-time-s", 2, "--json", "--mode", "by-time", "--full-by-s", 900)
    summary = json.loads(done.stdout)
    assert (summary["mode"], summary["full_by_s"]) == ("by-time", 900.0)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--mode", "by-time"), "bms: --mode by-time: needs the time; add --full-by-s"),
        (
            ("--full-by-s", 900, "--mode", "fastest"),
            "bms: --full-by-s 900: only mode by-time keeps a time; add --mode by-time",
        ),
        (
            ("--mode", "fastest", "--controller", "s-cbf"),
            "bms: --mode fastest: s-cbf has no modes; leave it out, or choose kan-rcbf",
        ),
    ],
)
def test_a_mode_that_cannot_be_is_told_in_one_line(options, line):
    done = bms("sil", *options)
    assert (done.returncode, done.stdout, done.stderr.splitlines()) == (2, "", [line])
