"""`--plant fmu:FILE`: a unit is the plant, or is refused in one line with all that it lacks."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

from bms.cell import Disturbance
from bms.errors import InputError, PlantError
from bms.presets import load_preset
from hil_sim.plant.catalog import make_plant
from hil_sim.plant.plant import Plant
from tests.hil_sim.plants import calm, started
from tests.hil_sim.units import PRESET, described, exported_plant, opened, written

LIBRARY = "binaries/x86_64-linux/kan_rcbf_plant.so"


def made(unit: Path, *renamings: str, preset=None):
    spec = ",".join([f"fmu:{unit}", *renamings])
    return make_plant(spec, preset or load_preset(PRESET), calm())


def without(name: str):
    """An edit that leaves a variable out, also where the structure of the model refers to it."""

    def edit(text: str) -> str:
        (reference,) = re.findall(rf'<Float64 name="{name}" valueReference="(\d+)"', text)
        text = re.sub(rf'    <Float64 name="{name}".*\n', "", text)
        return re.sub(rf'    <\w+ valueReference="{reference}"/>\n', "", text)

    return edit


def with_unit(name: str, unit: str | None):
    said = "" if unit is None else f' unit="{unit}"'
    return lambda text: re.sub(rf'(name="{name}"[^>]*?) unit="[^"]*"', rf"\1{said}", text)


def refused(tmp_path: Path, unit: bytes | dict[str, bytes], *renamings: str) -> str:
    with pytest.raises(InputError) as no:
        made(written(tmp_path, unit), *renamings)
    assert "\n" not in str(no.value)
    assert str(no.value).startswith(f"--plant fmu:{tmp_path / 'unit.fmu'}")
    return str(no.value)


def test_the_command_charges_the_cell_of_a_unit_as_that_of_the_preset(bms, tmp_path):
    """Summary and frames; a foreign cell has neither heat nor bound that the run could know of."""
    unit = written(tmp_path, exported_plant(3))
    summaries = []
    for plant, folder in ((f"fmu:{unit}", "unit"), ("two-mass", "own")):
        code, printed, error = bms(
            *("sil", "--plant", plant, "--max-time-s", 10, "--seed", 7, "--json"),
            *("--out", tmp_path / folder),
        )
        assert code == 1, error  # not full in so short a time
        summaries.append(json.loads(printed))
    unit_summary, own_summary = summaries
    for key in ("max_core_temperature_K", "max_voltage_V", "final_soc", "steps", "kan_rmse_K"):
        assert unit_summary[key] == own_summary[key]
    assert unit_summary["plant"] == f"fmu:{unit}"
    assert unit_summary["heat_J"] is None
    assert (tmp_path / "unit" / "can.log").read_bytes() == (tmp_path / "own/can.log").read_bytes()


def test_it_begins_as_the_preset_says_and_keeps_its_extremes(tmp_path):
    preset = started(load_preset(PRESET), 0.5, 300.0)
    unit, own = made(written(tmp_path, exported_plant(3)), preset=preset), Plant(preset, calm())
    assert unit.state == own.state == (0.5, 300.0, 300.0, 300.0)
    for current_A in (-20.0, -20.0, 0.0):
        for plant in (unit, own):
            plant.current_A = current_A
            plant.advance()
    assert unit.extremes.voltage_V == own.extremes.voltage_V > unit.voltage_V
    assert unit.extremes.core_temperature_K == own.extremes.core_temperature_K
    assert unit.extremes.soc == own.extremes.soc


def test_a_pump_that_fails_stops_the_cooling_of_the_unit(tmp_path):
    unit, own = made(written(tmp_path, exported_plant(3))), Plant(load_preset(PRESET), calm())
    for plant in (unit, own):
        plant.cooling_power_W = 0.0
        plant.advance()
    assert unit.cooling_power_W == 0.0
    assert unit.state == own.state


def test_names_of_ones_own_are_told_behind_the_file(tmp_path):
    renamed = described(
        exported_plant(3),
        lambda text: text.replace('"soc"', '"pack.charge"').replace('"current_A"', '"pack.I"'),
    )
    unit = made(written(tmp_path, renamed), "soc=pack.charge", "current_A=pack.I")
    unit.current_A = -10.0
    unit.advance()
    assert unit.state.soc > load_preset(PRESET).initial.soc


def test_everything_that_is_missing_is_named_at_once(tmp_path):
    said = refused(
        tmp_path,
        described(exported_plant(3), lambda t: without("soc")(without("core_temperature_K")(t))),
    )
    assert "no output soc (1); no output core_temperature_K (K); a plant needs these" in said
    assert "voltage_V" not in said
    assert ",current_A=NAME" in said


@pytest.mark.parametrize(
    ("name", "unit", "said"),
    [
        ("core_temperature_K", "degC", "core_temperature_K in degC, not in K"),
        ("voltage_V", "mV", "voltage_V in mV, not in V"),
        ("current_A", None, "current_A in no unit, not in A"),
        ("soc", "%", "soc in %, not in 1"),
        ("cooling_power_W", "kW", "cooling_power_W in kW, not in W"),
    ],
)
def test_a_variable_in_another_unit_is_refused(tmp_path, name, unit, said):
    assert said in refused(tmp_path, described(exported_plant(3), with_unit(name, unit)))


def test_a_state_of_charge_needs_no_unit(tmp_path):
    unit = described(exported_plant(3), with_unit("soc", None))
    assert made(written(tmp_path, unit)).state.soc == load_preset(PRESET).initial.soc


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (
            lambda text: text.replace('causality="input"', 'causality="local"', 1),
            "no input current_A (A): it is of causality local",
        ),
        (
            lambda text: text.replace('<Float64 name="soc"', '<Int32 name="soc"').replace(
                ' unit="1" description="State of charge"', ""
            ),
            "soc is of type Int32, not a real number",
        ),
        (
            lambda text: re.sub(
                r'(<Float64 name="soc"[^>]*)/>', r'\1><Dimension start="2"/></Float64>', text
            ),
            "soc is an array, not one number",
        ),
        (
            lambda text: re.sub(r"<CoSimulation", "<ModelExchange", text).replace(
                ' canHandleVariableCommunicationStepSize="true"', ""
            ),
            "is not for co-simulation",
        ),
        (lambda text: text.replace('fmiVersion="3.0"', 'fmiVersion="1.0"'), "FMI 1.0"),
        (lambda text: text[:200], "is no unit that FMPy can read"),
    ],
)
def test_a_unit_that_cannot_be_the_plant_is_refused(tmp_path, edit, said):
    assert said in refused(tmp_path, described(exported_plant(3), edit))


def test_a_unit_for_another_platform_names_those_that_it_is_for(tmp_path):
    files = opened(exported_plant(3))
    library = files.pop(LIBRARY)
    said = refused(tmp_path, files | {"binaries/x86_64-windows/kan_rcbf_plant.dll": library})
    assert f"has no {LIBRARY}, but libraries for x86_64-windows;" in said
    assert "fmpy compile" in said
    no_sources = {name: content for name, content in files.items() if "sources" not in name}
    assert "fmpy compile" not in refused(tmp_path, no_sources)


def test_a_library_that_cannot_be_loaded_is_told(tmp_path):
    said = refused(tmp_path, opened(exported_plant(3)) | {LIBRARY: b"not a library"})
    assert "does not start" in said


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("fmu", "give the path of a unit"),
        ("fmu:absent.fmu", "no such file"),
        ("fmu:README.md", "is no unit that FMPy can read"),
        ("fmu:a.fmu,speed=v", "'speed=v' names no variable; write current_A=NAME"),
        ("fmu:a.fmu,soc=", "'soc=' names no variable"),
    ],
)
def test_an_argument_that_means_nothing_is_refused_in_one_line(bms, spec, said):
    code, printed, error = bms("sil", "--plant", spec, "--max-time-s", 1)
    assert (code, printed, error.count("\n")) == (2, "", 1)
    assert said in error


def test_a_name_of_ones_own_that_the_unit_has_not_is_missing(tmp_path):
    assert "no output cooler (W)" in refused(tmp_path, exported_plant(3), "cooling_power_W=cooler")


def test_a_disturbance_of_the_rates_is_refused(tmp_path):
    heat = iter([Disturbance(core_K_per_s=1e-4)] * 100)
    spec = f"fmu:{written(tmp_path, exported_plant(3))}"
    with pytest.raises(InputError, match="takes no disturbance of its rates; leave --disturbance"):
        make_plant(spec, load_preset(PRESET), heat)


def test_without_an_input_for_the_cooler_its_failure_is_refused(tmp_path):
    unit = described(
        exported_plant(3),
        lambda text: without("full_cooling_power_W")(without("cooling_power_W")(text)),
    )
    plant = made(written(tmp_path, unit))
    assert plant.cooling_power_W == load_preset(PRESET).initial.cooling_power_W
    with pytest.raises(InputError, match=r"has no input full_cooling_power_W \(W\)"):
        plant.cooling_power_W = 0.0


def test_what_a_unit_says_when_it_fails_is_passed_on(tmp_path):
    plant = made(written(tmp_path, exported_plant(2)))
    with pytest.raises(PlantError, match=r"unit.fmu: fmi2SetReal: a variable that cannot be set"):
        plant.current_A = float("nan")


def test_without_fmpy_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(InputError, match=r"FMPy is not installed; run pip install .*\[fmi\]"):
        make_plant("fmu:a.fmu", load_preset(PRESET), calm())
