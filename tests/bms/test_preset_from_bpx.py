"""`bms preset new --from-bpx`: what stands in the file stands in the form, and nothing else."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bms.identification.bpx.cell import known_of
from bms.identification.bpx.file import read_bpx
from bms.presets import load_preset
from bms.presets.authoring.complaints import complaints
from bms.presets.authoring.form import form
from bms.validation import read_toml
from tests.bms.bpx_samples import (
    lg_m50,
    negative_entropy_V_per_K,
    negative_V,
    positive_entropy_V_per_K,
    positive_V,
    written,
)

pytest.importorskip("bpx", reason="not run: bpx is not installed; it comes with the extra bpx")

Edit = Callable[[dict[str, Any]], object]


def cell_of(content: dict[str, Any]) -> dict[str, Any]:
    return content["Parameterisation"]["Cell"]


def electrode(content: dict[str, Any], sign: str = "Positive") -> dict[str, Any]:
    return content["Parameterisation"][f"{sign} electrode"]


def stoichiometries(soc: float) -> tuple[float, float]:
    return 0.9084 + soc * (0.2661 - 0.9084), 0.0279 + soc * (0.9014 - 0.0279)


def values_of(tmp_path: Path, *edits: Edit, geometry: str | None = "21700") -> dict[str, Any]:
    content = lg_m50()
    for edit in edits:
        edit(content)
    known = known_of(read_bpx(written(tmp_path, content)), geometry)
    return {key: one.value for key, one in known.items()}


def test_numbers_of_the_file_stand_in_the_form_with_their_fields(bms, tmp_path) -> None:
    path = written(tmp_path, lg_m50())
    out = tmp_path / "m50.toml"
    code, said, err = bms(
        "preset", "new", "m50", "--from-bpx", path, "--geometry", "21700", "--out", out
    )
    assert (code, err) == (0, "")
    preset, text = read_toml(out), out.read_text(encoding="utf-8")
    cell = preset["cell"]
    assert preset["name"] == "m50"
    assert preset["sources"] == [
        "BPX file cell.json, version 1.1.0, model SPM: LG M50",
        "Chen et al. 2020, O'Regan et al. 2022",
    ]
    assert cell["capacity_Ah"] == 5.0
    assert preset["limits"]["max_voltage_V"] == 4.2
    assert preset["initial"]["temperature_K"] == 296.0
    whole = 2826.0 * 1000.0 * 2.42e-5
    assert cell["surface_heat_capacity_J_per_K"] == pytest.approx(0.08 * whole, rel=1e-3)
    assert cell["core_heat_capacity_J_per_K"] == pytest.approx(0.92 * whole, rel=1e-3)
    assert cell["surface_resistance_K_per_W"] == pytest.approx(1 / (20.0 * 0.00531), rel=1e-3)
    radial = 1.0 / (4.0 * math.pi * 0.8 * 0.93 * 0.070)
    assert cell["core_resistance_K_per_W"] == pytest.approx(radial, rel=1e-3)
    for key, field in {
        "capacity_Ah": "Cell: Nominal cell capacity [A.h]",
        "max_voltage_V": "Cell: Upper voltage cut-off [V]",
        "temperature_K": "State: Initial conditions: Initial temperature [K]",
        "core_resistance_K_per_W": "User-defined: Thermal conductivity [W.m-1.K-1]",
        "voltage_V": "Positive electrode: OCP [V]",
        "V_per_K": "Positive electrode: Entropic change coefficient [V.K-1]",
    }.items():
        line = re.search(rf"^{key} = .*  # (?:.*)$", text, re.MULTILINE)
        assert line is not None, key
        assert f"BPX file cell.json, {field}" in line[0]
    for key in ("ohmic_resistance_ohm", "reference_current_A", "max_core_temperature_K"):
        assert f'\n{key} = ""\n' in text
        assert re.search(rf"^[\w.]+{key}: to fill in: BPX has none", said, re.MULTILINE)


def test_open_circuit_voltage_and_entropy_are_the_difference_of_the_electrodes(tmp_path) -> None:
    known = values_of(tmp_path)
    soc, voltage_V = known["cell.ocv.soc"], known["cell.ocv.voltage_V"]
    assert (soc[0], soc[-1]) == (0.0, 1.0)
    assert len(soc) <= 64
    expected_V = [positive_V(y) - negative_V(x) for y, x in map(stoichiometries, soc)]
    assert voltage_V == pytest.approx(expected_V, abs=1e-5)
    between = np.linspace(0.0, 1.0, 1777)
    curve_V = [positive_V(y) - negative_V(x) for y, x in map(stoichiometries, between)]
    assert np.interp(between, soc, voltage_V) == pytest.approx(curve_V, abs=1.1e-3)
    curve = [
        positive_entropy_V_per_K(y) - negative_entropy_V_per_K(x)
        for y, x in map(stoichiometries, known["cell.entropy.soc"])
    ]
    # The file has a table every 0.02 of the positive electrode's.
    assert known["cell.entropy.V_per_K"] == pytest.approx(curve, abs=8e-6)
    mean = np.mean(
        [positive_entropy_V_per_K(y) - negative_entropy_V_per_K(x)
         for y, x in map(stoichiometries, between)]
    )  # fmt: skip
    assert known["cell.entropic_coefficient_V_per_K"] == pytest.approx(mean, abs=1e-6)


def test_filled_in_it_is_a_preset(tmp_path) -> None:
    path = written(tmp_path, lg_m50())
    text = form("m50", known_of(read_bpx(path), "21700"))
    others = {
        "ohmic_resistance_ohm": 0.03, "coolant_heat_capacity_J_per_K": 140.0, "max_soc": 1.0,
        "max_core_temperature_K": 323.15, "max_surface_temperature_K": 323.15,
        "reference_current_A": -5.0, "current_growth_A_per_s": 2.5, "completion_soc": 0.98,
        "soc_per_s": 0.0, "core_K_per_s": 1e-3, "surface_K_per_s": 1e-3, "coolant_K_per_s": 1e-3,
        "surface_rate_K_per_s2": 0.01, "soc": 0.1, "cooling_power_W": [0.0, 3.0],
        "surface_temperature_K": [281.0, 326.15], "coolant_temperature_K": [273.0, 326.15],
        "current_A": [-5.3, 1.0],
    }  # fmt: skip
    for key, value in others.items():
        text = re.sub(rf'^{key} = (""|\[\])$', f"{key} = {value}", text, flags=re.MULTILINE)
    text = text.replace("cooling_power_W = [0.0, 3.0]", "cooling_power_W = 1.0", 1)
    text = re.sub(r'(resolution|noise_std|bias) = ""', r"\1 = 0.001", text)
    out = tmp_path / "m50.toml"
    out.write_text(text, encoding="utf-8")
    assert complaints(out) == []
    assert load_preset(out).cell.entropy is not None


def test_a_file_of_version_0_tells_its_own_temperature_and_conductivity(tmp_path) -> None:
    def old(content: dict[str, Any]) -> None:
        content["Header"]["BPX"] = 0.4
        del content["State"], content["Parameterisation"]["User-defined"]
        cell_of(content)["Thermal conductivity [W.m-1.K-1]"] = 0.8

    radial = values_of(tmp_path)["cell.core_resistance_K_per_W"]
    known = values_of(tmp_path, old)
    assert known["cell.core_resistance_K_per_W"] == radial
    assert "initial.temperature_K" not in known
    known = values_of(
        tmp_path, old, lambda content: cell_of(content).update({"Initial temperature [K]": 290.0})
    )
    assert known["initial.temperature_K"] == 290.0


def test_what_a_file_lacks_is_left_open(tmp_path) -> None:
    def poor(content: dict[str, Any]) -> None:
        del cell_of(content)["Density [kg.m-3]"]
        del electrode(content)["Entropic change coefficient [V.K-1]"]
        del content["State"]

    known = values_of(tmp_path, poor, geometry=None)
    assert {key for key, value in known.items() if value is None} >= {
        "cell.core_heat_capacity_J_per_K", "cell.surface_heat_capacity_J_per_K",
        "cell.entropic_coefficient_V_per_K", "cell.surface_resistance_K_per_W",
        "cell.core_resistance_K_per_W",
    }  # fmt: skip
    assert "cell.entropy.soc" not in known


def test_a_blend_leaves_voltage_and_entropy_open(tmp_path) -> None:
    def blend(content: dict[str, Any]) -> None:
        positive = electrode(content)
        thickness = {"Thickness [m]": positive.pop("Thickness [m]")}
        content["Parameterisation"]["Positive electrode"] = thickness | {
            "Particle": {"Primary": positive}
        }

    known = values_of(tmp_path, blend)
    open_keys = {key for key, value in known.items() if value is None}
    assert open_keys >= {"cell.ocv.soc", "cell.entropic_coefficient_V_per_K"}
    assert known.keys().isdisjoint({"cell.ocv.voltage_V", "cell.entropy.soc"})
    assert known["cell.capacity_Ah"] == 5.0


def test_another_capacity_of_the_electrodes_and_their_hysteresis_are_told(tmp_path) -> None:
    content = lg_m50()
    cell_of(content)["Nominal cell capacity [A.h]"] = 4.5
    electrode(content)["OCP (lithiation) [V]"] = electrode(content)["OCP [V]"]
    known = known_of(read_bpx(written(tmp_path, content)), None)
    # Chen et al.: 0.1027 m2 of 85.2 um with 0.75 of 33133 mol/m3 from 0.0279 to 0.9014.
    held_Ah = 0.1027 * 85.2e-6 * 0.75 * 33133 * (0.9014 - 0.0279) * 96485.33 / 3600
    assert f"hold {held_Ah:.4g} A h between" in known["cell.capacity_Ah"].note
    assert known["cell.capacity_Ah"].value == 4.5
    assert "hysteresis" in known["cell.ocv.voltage_V"].note


def test_a_conductivity_that_none_has_across_its_layers_is_not_used(tmp_path) -> None:
    """One of the whole cell would make the core seem colder than it may be."""
    user = "User-defined"
    edits = (
        lambda content: content["Parameterisation"].pop(user),
        lambda content: content["Parameterisation"][user].update(
            {"Thermal conductivity [W.m-1.K-1]": 1.9}
        ),
    )
    published, whole = (values_of(tmp_path, edit)["cell.core_resistance_K_per_W"] for edit in edits)
    assert whole == published == pytest.approx(1 / (4 * math.pi * 0.45 * 0.93 * 0.07), rel=1e-3)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda c: c.pop("Header"), "no BPX file; give a BPX file: JSON or YAML"),
        (lambda c: c["Header"].pop("BPX"), "Header: BPX: is no version such as 1.1.0"),
        (lambda c: c["Header"].update(BPX="99.0.0"), "version 99.0.0 is newer than the package"),
        (lambda c: c["Parameterisation"].pop("Cell"), "Parameterisation: Cell: is missing"),
        (
            lambda c: electrode(c).pop("Maximum stoichiometry"),
            "Maximum stoichiometry: Field required",
        ),
        (
            lambda c: cell_of(c).update({"Density [kg.m-3]": math.nan}),
            "Cell: Density [kg.m-3]: nan is no number",
        ),
        (
            lambda c: cell_of(c).update({"Nominal cell capacity [A.h]": -5.0}),
            "Cell: Nominal cell capacity [A.h]: must be above 0",
        ),
        (
            lambda c: cell_of(c).update({"Lower voltage cut-off [V]": 4.3}),
            "Lower voltage cut-off [V]: not below the upper one",
        ),
        (
            lambda c: electrode(c).update({"OCP [V]": "exit(x)"}),
            "Positive electrode: OCP [V]: has what is no number, x,",
        ),
        (
            lambda c: electrode(c).update({"OCP [V]": "9 ** 9 ** 9 ** 9"}),
            "Positive electrode: OCP [V]: is not finite",
        ),
        (
            lambda c: electrode(c).update({"OCP [V]": {"x": [0.5, 0.2], "y": [4.0, 3.0]}}),
            "Positive electrode: OCP [V]: needs a table whose x rise",
        ),
        (
            lambda c: electrode(c).update({"OCP [V]": "3 + x"}),
            "the open-circuit voltage falls with the state of charge",
        ),
        (
            lambda c: electrode(c).update({"Maximum stoichiometry": 1.2}),
            "Positive electrode: Minimum stoichiometry: must be 0 to",
        ),
        (
            lambda c: cell_of(c).update({"Volume [m3]": 1.65e-5}),
            "--geometry 21700: has 24.25 cm3, but cell.json 16.5 cm3",
        ),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(bms, tmp_path, edit, said) -> None:
    content = lg_m50()
    edit(content)
    path, out = written(tmp_path, content), tmp_path / "m50.toml"
    code, printed, err = bms(
        "preset", "new", "m50", "--from-bpx", path, "--geometry", "21700", "--out", out
    )
    assert (code, printed) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert not out.exists()


def test_yaml_is_read_as_json_is(tmp_path) -> None:
    path = tmp_path / "cell.yaml"
    path.write_text(json.dumps(lg_m50()), encoding="utf-8")
    known = known_of(read_bpx(path), "21700")
    values = {key: one.value for key, one in known.items() if key != "sources"}
    assert values == {k: v for k, v in values_of(tmp_path).items() if k != "sources"}


def test_without_the_package_one_line_names_the_extra(bms, monkeypatch, tmp_path) -> None:
    monkeypatch.setitem(sys.modules, "bpx", None)
    path = written(tmp_path, lg_m50())
    code, out, err = bms("preset", "new", "m", "--from-bpx", path, "--out", tmp_path / "m.toml")
    assert (code, out) == (2, "")
    assert err == "bms: --from-bpx: bpx is not installed; pip install 'kan-rcbf-bms[bpx]'\n"


def test_a_shape_without_a_file_is_refused(bms, tmp_path) -> None:
    code, _, err = bms("preset", "new", "m", "--geometry", "18650", "--out", tmp_path / "m.toml")
    assert code == 2
    assert "give it with --from-bpx" in err
