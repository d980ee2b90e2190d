"""`bms preset`: an empty form, all complaints at once, what an edit needs."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bms.errors import ModelMismatchError
from bms.identification.preset_toml import preset_toml
from bms.model.model_file import load_shipped_model
from bms.model.pair import check_pair
from bms.presets import Preset, load_preset, preset_names, preset_path
from bms.presets.authoring.complaints import complaints
from bms.presets.authoring.difference import differences, flattened
from bms.presets.authoring.form import form
from bms.presets.authoring.keys import explanation, keys, tables
from tests.bms.plausible_presets import other_cells

LIN2014 = preset_path("lin2014").read_text(encoding="utf-8")


def written(folder: Path, *edits: tuple[str, str], text: str = LIN2014) -> Path:
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "cell.toml"
    path.write_text(text, encoding="utf-8")
    return path


def complained(folder: Path, *edits: tuple[str, str]) -> dict[str, str]:
    """What is said of each key, remedy included."""
    return {one.key: f"{one.what} | {one.remedy}" for one in complaints(written(folder, *edits))}


def required_keys() -> set[str]:
    optional = {table.path for table in tables() if table.is_optional}
    return {k.path for k in keys().values() if not k.is_optional and k.table not in optional}


def test_every_key_and_table_is_explained() -> None:
    assert [path for path in keys() if explanation(path) is None] == []
    form("any")  # raises where a table is not


def test_the_form_asks_for_every_key_that_is_needed_and_has_no_number_of_a_cell(tmp_path) -> None:
    path = written(tmp_path, text=form("my_cell"))
    asked = {one.key for one in complaints(path)}
    given = {"name", "timing.sampling_period_s", "timing.delay_s"}
    given |= {f"gains.{gain}" for gain in ("alpha1_per_s", "alpha3_per_s2", "alpha4_per_s")}
    assert asked == required_keys() - given
    values = re.findall(r"^(?:# )?(\w+) = (.*)$", path.read_text(), re.MULTILINE)
    with_a_number = {key for key, value in values if re.search(r"\d", value)}
    assert with_a_number == {key.split(".")[-1] for key in given if key != "name"}
    elsewhere = {"resolution", "noise_std", "bias"}
    assert {key for key, _ in values} >= {k.name for k in keys().values()} - elsewhere


def test_a_form_that_is_filled_in_is_a_preset(tmp_path) -> None:
    """The values of a published cell, put where the form has its empty ones."""
    values = flattened(load_preset("lin2014"))
    lines, table = [], ""
    for line in form("my_cell").splitlines():
        if (heading := re.fullmatch(r"\[([\w.]+)\]", line)) is not None:
            table = heading[1]
        filled = line
        if (empty := re.fullmatch(r'(\w+) = (""|\[\])', line)) is not None:
            filled = f"{empty[1]} = {json.dumps(values[f'{table}.{empty[1]}'.strip('.')])}"
        elif (channel := re.fullmatch(r"(\w+) = \{ .* \}", line)) is not None:
            parts = ("resolution", "noise_std", "bias")
            filled = f"{channel[1]} = {{ " + ", ".join(
                f"{part} = {values[f'sensors.{channel[1]}.{part}']}" for part in parts
            ) + " }"  # fmt: skip
        lines.append(filled)
    path = written(tmp_path, text="\n".join(lines))
    assert complaints(path) == []
    assert load_preset(path).cell == load_preset("lin2014").cell


@pytest.mark.parametrize("name", preset_names())
def test_shipped_presets_have_no_complaints(name: str) -> None:
    assert complaints(preset_path(name)) == []


@pytest.mark.parametrize("name", other_cells())
def test_presets_of_other_cells_have_no_complaints(name: str, tmp_path: Path) -> None:
    preset = replace(other_cells()[name], description="of a test", sources=("a test",))
    assert complaints(written(tmp_path, text=preset_toml(preset))) == []


def test_all_complaints_come_at_once(tmp_path) -> None:
    said = complained(
        tmp_path,
        ("capacity_Ah = 2.3\n", ""),
        ("ohmic_resistance_ohm = 0.0114", 'ohmic_resistance_ohm = "11.4 mohm"'),
        ("core_heat_capacity_J_per_K", "core_heat_capacity"),
        ("max_core_temperature_K = 323.0", "max_core_temperature_K = 50.0"),
        ("reference_current_A = -23.0", "reference_current_A = 23.0"),
        ("alpha4_per_s = 0.192", "alpha4_per_s = 0.1"),
        ("max_voltage_V = 3.6", "max_voltage_V = 7.2"),
        ("surface_temperature_K = [283.0, 326.0]", "surface_temperature_K = [326.0, 283.0]"),
        ("cooling_power_W = [0.0, 3.0]", "cooling_power_W = [3.0, 3.0]"),
    )
    assert said.keys() == {
        "cell.capacity_Ah", "cell.ohmic_resistance_ohm", "cell.core_heat_capacity",
        "cell.core_heat_capacity_J_per_K", "limits.max_core_temperature_K",
        "limits.reference_current_A", "gains", "limits.max_voltage_V",
        "operating_box.surface_temperature_K", "operating_box.cooling_power_W",
    }  # fmt: skip
    assert "is missing | fill it in in A h: charge from empty to full" in said["cell.capacity_Ah"]
    assert "'11.4 mohm': " in said["cell.ohmic_resistance_ohm"]
    assert "core_heat_capacity_J_per_K" in said["cell.core_heat_capacity"]
    assert "in kelvin these are 323.15" in said["limits.max_core_temperature_K"]
    assert "negative: -23;" in said["limits.reference_current_A"]
    assert "carries 0 to 6.5533" in said["limits.max_voltage_V"]


@pytest.mark.parametrize(
    ("edit", "key", "said"),
    [
        (("capacity_Ah = 2.3", "capacity_Ah = 2300.0"), "cell.capacity_Ah", "2.3 if these are mA"),
        (
            ("ohmic_resistance_ohm = 0.0114", "ohmic_resistance_ohm = 11.4"),
            "cell.ohmic_resistance_ohm",
            "0.0114 if these are milliohm",
        ),
        (
            ("core_heat_capacity_J_per_K = 62.7", "core_heat_capacity_J_per_K = 0.0627"),
            "cell.core_heat_capacity_J_per_K",
            "whole cell in J/K",
        ),
        (
            ("max_voltage_V = 3.6", "max_voltage_V = 3.44"),
            "limits.max_voltage_V",
            "never complete",
        ),
        (
            ("temperature_K = 298.15\n", "temperature_K = 280.0\n"),
            "operating_box.surface_temperature_K",
            "no charge begins",
        ),
        (
            ("cooling_power_W = 1.0", "cooling_power_W = 3.5"),
            "operating_box.cooling_power_W",
            "no charge begins",
        ),
        (("soc = 0.1\n", "soc = 0.99\n"), "initial.soc", "nothing is charged"),
    ],
)
def test_values_of_no_cell_and_charges_that_cannot_be_are_told(
    tmp_path: Path, edit: tuple[str, str], key: str, said: str
) -> None:
    load_preset(written(tmp_path, edit))  # right for the schema
    found = complained(tmp_path, edit)
    assert said in found[key]


def test_the_voltage_at_completion_is_told_from_both_sides(tmp_path) -> None:
    """The open-circuit voltage of lin2014 at 0.99 is 3.440 V."""
    for limit_V, keys_told in ((3.440, {"limits.max_voltage_V"}), (3.4401, set())):
        edit = ("max_voltage_V = 3.6", f"max_voltage_V = {limit_V}")
        assert complained(tmp_path, edit).keys() == keys_told


def test_what_a_family_can_prove_of_a_full_cell_is_told_from_both_sides(tmp_path) -> None:
    """Of samsung_30q: 4.2 V less 15 mV of its curve and twice 4.05 mV of the sensor, 4.1769 V."""
    preset = load_preset("samsung_30q")
    proven_V = 4.2 - 0.015 - 2.0 * 0.00405
    edge = float(np.interp(proven_V, preset.cell.ocv.voltage_V, preset.cell.ocv.soc))
    text = preset_path("samsung_30q").read_text(encoding="utf-8")
    for soc, keys_told in ((edge + 1e-4, {"limits.completion_soc"}), (edge - 1e-4, set())):
        edit = ("completion_soc = 0.937", f"completion_soc = {soc:.6f}")
        path = written(tmp_path, edit, text=text)
        assert {complaint.key for complaint in complaints(path)} == keys_told


def test_file_that_is_no_toml_or_not_there_is_refused_in_one_line(bms, tmp_path) -> None:
    broken = written(tmp_path, ("capacity_Ah = 2.3", "capacity_Ah = "))
    for path in (broken, tmp_path / "none.toml"):
        code, out, err = bms("preset", "check", path)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert str(path) in err


def test_codes_and_lines_of_a_check(bms, tmp_path) -> None:
    path = written(tmp_path, ("capacity_Ah = 2.3", "capacity_Ah = -2.3"))
    code, out, err = bms("preset", "check", path)
    assert (code, err) == (1, "")
    assert out.startswith("cell.capacity_Ah: -2.3: input should be greater than 0\n")
    assert out.endswith("cell.toml: 1 thing to mend\n")
    assert bms("preset", "check", "lin2014")[0] == 0
    told = json.loads(bms("preset", "check", path, "--json")[1])
    assert [one["key"] for one in told["complaints"]] == ["cell.capacity_Ah"]


def test_new_overwrites_nothing(bms, tmp_path) -> None:
    path = tmp_path / "cell.toml"
    assert bms("preset", "new", "mine", "--out", path)[0] == 0
    path.write_text("of somebody", encoding="utf-8")
    code, _, err = bms("preset", "new", "mine", "--out", path)
    assert (code, path.read_text()) == (2, "of somebody")
    assert "is there already" in err
    assert bms("preset", "new", "mine", "--out", tmp_path / "cell.txt")[0] == 2


def test_show_has_every_value(bms) -> None:
    code, out, _ = bms("preset", "show", "lin2014")
    assert code == 0
    assert re.search(r"cell\.ohmic_resistance_ohm +0\.0114 +ohm", out)
    content = json.loads(bms("preset", "show", "a123_26650", "--json")[1])
    assert content["cell"]["interval"]["resistance"] == [0.8, 2.0]


EDITS: dict[str, Preset] = {
    "limits.max_voltage_V": 3.65, "cell.core_resistance_K_per_W": 2.0, "initial.soc": 0.2,
    "limits.reference_current_A": -20.0, "timing.sampling_period_s": 0.05, "description": "other",
    "sensors.voltage_V.bias": 0.001, "sensors.current_A.bias": 0.001, "gains.alpha1_per_s": 0.04,
    "uncertainty.core_K_per_s": 1e-3, "limits.max_core_temperature_K": 320.0,
    "operating_box.surface_temperature_K": [283.0, 327.0], "cell.ocv.overfill_slope_V": 15.0,
}  # fmt: skip


@pytest.mark.parametrize(("key", "value"), EDITS.items())
def test_an_edit_needs_training_where_the_shipped_model_is_refused_for_it(
    tmp_path: Path, key: str, value: object
) -> None:
    """The judge is what refuses a stale pair."""
    first = load_preset("lin2014")
    content = preset_toml(first)
    table, _, name = key.rpartition(".")
    text = re.sub(
        rf"(\[{re.escape(table)}\]\n(?:[^\[\n]*\n|\w[^\n]*\n)*?){name} = [^\n]*" if table
        else rf"(){name} = [^\n]*",
        lambda found: f"{found[1]}{name} = {json.dumps(value)}",
        content, count=1,
    )  # fmt: skip
    second = load_preset(written(tmp_path, text=text))

    ((found),) = differences(first, second)

    assert found.key == key
    try:
        check_pair(second, load_shipped_model("lin2014"))
        is_stale = False
    except ModelMismatchError:
        is_stale = True
    assert found.needs_training == is_stale
    assert found.needs_certificate == (key != "description")
    assert found.needs[-1] == "tables"
    assert second.hash != first.hash  # what the tables carry


def test_diff_says_what_has_to_be_made_anew(bms, tmp_path) -> None:
    path = written(tmp_path, ("max_voltage_V = 3.6", "max_voltage_V = 3.65"))
    code, out, _ = bms("preset", "diff", "lin2014", path)
    assert code == 0
    assert re.search(r"limits\.max_voltage_V +3\.6 +3\.65 +certificate, tables", out)
    assert "training" not in out
    assert bms("preset", "diff", "lin2014", "lin2014")[1] == "lin2014 and lin2014: no difference\n"
