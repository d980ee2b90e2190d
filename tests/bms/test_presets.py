"""Presets load completely or not at all; every complaint names the file and the key."""

from __future__ import annotations

import copy
import json
import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.bounds.derive import error_bound_parts_K
from bms.bounds.worst_case import Effort, worst_case
from bms.calibration.plausibility import plausibility_fields
from bms.cell.parameters import OpenCircuitVoltage
from bms.data.profiles import draw_profiles
from bms.data.simulate import simulate
from bms.errors import InputError
from bms.model.model_file import load_model, shipped_model_path
from bms.presets import DEFAULT_PRESET, load_preset, preset_names, preset_path
from bms.presets.digest import digest
from bms.presets.schema import Sensor, Uncertainty
from bms.validation import read_json, read_toml

CONTENT = read_toml(preset_path(DEFAULT_PRESET))
MAY_BE_NEGATIVE = {"cell.entropic_coefficient_V_per_K", "limits.reference_current_A"}


def leaves(content, path=()):
    """Paths of all values that are no tables."""
    for key, value in content.items():
        if isinstance(value, dict):
            yield from leaves(value, (*path, key))
        else:
            yield (*path, key)


def at(content, path):
    for key in path:
        content = content[key]
    return content


def as_toml(content):
    """TOML text of a preset's content; a key without table comes before the tables."""

    def text(value):
        if isinstance(value, dict):
            return "{" + ", ".join(f"{key} = {text(item)}" for key, item in value.items()) + "}"
        if isinstance(value, list):
            return "[" + ", ".join(map(text, value)) + "]"
        return str(value) if isinstance(value, float) else json.dumps(value)

    ordered = sorted(content.items(), key=lambda item: isinstance(item[1], dict))
    return "\n".join(f"{key} = {text(value)}" for key, value in ordered)


ALL = sorted(leaves(CONTENT))
NUMBERS = [path for path in ALL if isinstance(at(CONTENT, path), int | float)]
LISTS = [path for path in ALL if isinstance(at(CONTENT, path), list)]


def names(paths):
    return [".".join(path) for path in paths]


@pytest.fixture
def load(tmp_path):
    """Preset from content with one value replaced, or removed when the new value is `...`."""

    def load_changed(path=(), value=None):
        content = copy.deepcopy(CONTENT)
        if path:
            table = at(content, path[:-1])
            if value is ...:
                del table[path[-1]]
            else:
                table[path[-1]] = value
        file = tmp_path / "changed.toml"
        file.write_text(as_toml(content), encoding="utf-8")
        return load_preset(file)

    return load_changed


def refused(load, path, value):
    with pytest.raises(InputError) as caught:
        load(path, value)
    message = str(caught.value)
    assert "changed.toml" in message and "\n" not in message
    return message


def test_the_shipped_presets_are_these_and_carry_their_names():
    assert preset_names() == [
        "a123_26650",
        "a123_26650_10C",
        "lin2014",
        "paper_calibrated",
        "samsung_30q",
    ]
    for name in preset_names():
        preset = load_preset(name)
        assert preset.name == name
        assert preset.sources


def test_a_copy_by_path_is_the_same_preset(load):
    assert load() == load_preset(DEFAULT_PRESET)


NEEDED = [path for path in ALL if path != ("gains", "surface_condition")]


@pytest.mark.parametrize("path", NEEDED, ids=names(NEEDED))
def test_a_missing_key_is_named(load, path):
    assert ".".join(path) in refused(load, path, ...)


@pytest.mark.parametrize("path", ALL, ids=names(ALL))
def test_text_or_a_number_in_the_wrong_place_is_named(load, path):
    wrong = 1.0 if isinstance(at(CONTENT, path), str) else "3.0"
    assert ".".join(path) in refused(load, path, wrong)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf], ids=str)
@pytest.mark.parametrize("path", NUMBERS, ids=names(NUMBERS))
def test_a_number_that_is_not_finite_is_named(load, path, value):
    assert ".".join(path) in refused(load, path, value)


@pytest.mark.parametrize("path", LISTS, ids=names(LISTS))
def test_a_list_with_nan_or_text_names_its_element(load, path):
    numeric = not isinstance(at(CONTENT, path)[0], str)
    for wrong in (math.nan, "x") if numeric else (1.0,):
        values = [wrong, *at(CONTENT, path)[1:]]
        assert ".".join(path) + ".0" in refused(load, path, values)


@pytest.mark.parametrize("path", NUMBERS, ids=names(NUMBERS))
def test_a_sign_that_has_no_meaning_is_named(load, path):
    key = ".".join(path)
    if key == "limits.reference_current_A":
        assert key in refused(load, path, 23.0)
    elif key in MAY_BE_NEGATIVE or path[-1] == "bias":
        load(path, -abs(at(CONTENT, path)))
    else:
        assert key in refused(load, path, -1.0)


@pytest.mark.parametrize("section", ["", "cell", "limits", "sensors.voltage_V"])
def test_an_unknown_key_is_named(load, section):
    path = (*filter(None, section.split(".")), "typing_error")
    assert ".".join(path) in refused(load, path, 1.0)


@pytest.mark.parametrize("key", sorted(CONTENT["operating_box"]))
def test_a_range_that_does_not_rise_is_named(load, key):
    low, high = CONTENT["operating_box"][key]
    for wrong in ([high, low], [low, low]):
        assert key in refused(load, ("operating_box", key), wrong)


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (("operating_box", "current_A"), [-22.0, 0.5], "operating_box.current_A"),
        (("operating_box", "current_A"), [-24.0, -0.5], "operating_box.current_A"),
        (("limits", "completion_soc"), 1.01, "limits.completion_soc"),
        (("initial", "soc"), 1.01, "initial.soc"),
        (("timing", "sampling_period_s"), 0.0015, "sampling_period_s: Input should be a multiple"),
        (("timing", "sampling_period_s"), 0.1001, "sampling_period_s: Input should be a multiple"),
        (("gains", "alpha3_per_s2"), 0.172, "gains"),
        (("gains", "alpha4_per_s"), 0.44, "gains"),
    ],
)
def test_values_that_do_not_go_together_are_refused(load, path, value, named):
    assert named in refused(load, path, value)


def test_gains_with_a_double_real_root_are_the_last_that_are_accepted(load):
    double_root = 0.829**2 / 4.0
    assert load(("gains", "alpha3_per_s2"), double_root).gains.alpha3_per_s2 == double_root


def test_the_core_gain_defaults_to_the_core_time_constant(load):
    preset = load()
    cell = preset.cell
    assert preset.gains.core_gain_per_s(cell) == pytest.approx(
        1 / (cell.core_resistance_K_per_W * cell.core_heat_capacity_J_per_K)
    )
    assert load(("gains", "alpha2_per_s"), 0.03).gains.core_gain_per_s(cell) == 0.03


def test_an_unknown_name_lists_the_names_there_are():
    with pytest.raises(InputError, match=r"lin2015.*lin2014, paper_calibrated"):
        load_preset("lin2015")


def test_an_absent_file_and_a_syntax_error_name_the_file(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.toml: no such file"):
        load_preset(tmp_path / "nowhere.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text('name = "x"\n[cell\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"broken\.toml: not valid TOML.*line 2"):
        load_preset(broken)


@pytest.mark.parametrize("path", NUMBERS, ids=names(NUMBERS))
def test_the_hash_changes_with_every_number(load, path):
    value = at(CONTENT, path)
    other = value + 0.001 if path[-1] == "sampling_period_s" else value * 0.999 or 1e-6
    changed = load(path, other)
    assert changed.hash != load().hash


@pytest.mark.parametrize(
    ("path", "value", "same"),
    [
        (("cell", "ohmic_resistance_ohm"), 0.02, False),
        (("operating_box", "cooling_power_W"), [0.0, 9.0], False),
        (("cell", "capacity_Ah"), 2.4, False),
        (("cell", "ocv"), {"soc": [0.0, 1.0], "voltage_V": [3.0, 3.4]}, True),
        (("uncertainty", "core_K_per_s"), 1e-3, True),
        (("sensors", "surface_temperature_K", "noise_std"), 0.3, False),
        (("sensors", "voltage_V", "noise_std"), 0.3, True),
        (("limits", "reference_current_A"), -20.0, False),
        (("limits", "max_core_temperature_K"), 320.0, True),
        (("limits", "max_core_temperature_K"), 323.1, False),
        (("limits", "max_voltage_V"), 3.5, True),
        (("timing", "sampling_period_s"), 0.05, False),
        (("gains", "alpha2_per_s"), 0.03, True),
        (("description",), "other words", True),
    ],
)
def test_only_what_training_depends_on_makes_a_model_stale(load, path, value, same):
    changed = load(path, value)
    assert changed.hash != load().hash
    assert (changed.training_hash == load().training_hash) is same


@pytest.mark.slow
def test_what_estimators_are_made_of_is_the_same_for_the_same_training_hash(load):
    """Data, search and parts of the bound, after a change of all that the hash leaves out."""
    other = load_preset("lin2014")
    preset = load()
    changed = replace(
        preset,
        cell=replace(preset.cell, ocv=OpenCircuitVoltage((0.0, 1.0), (3.0, 3.4))),
        limits=replace(
            other.limits, max_voltage_V=3.5, max_surface_temperature_K=320.0, completion_soc=0.9,
            max_core_temperature_K=315.0, current_growth_A_per_s=1.0, max_soc=0.95,
        ),
        gains=replace(preset.gains, alpha1_per_s=0.1, alpha2_per_s=0.01, alpha4_per_s=0.7),
        uncertainty=Uncertainty(1e-6, 1e-3, 1e-3, 1e-3, 0.2),
        timing=replace(preset.timing, delay_s=0.0),
        sensors=replace(preset.sensors, voltage_V=Sensor(0.1, 0.1, 0.1)),
        initial=other.initial,
    )  # fmt: skip
    assert changed.training_hash == preset.training_hash
    network = load_model(shipped_model_path(DEFAULT_PRESET, lagged=True)).network

    def made(of):
        profiles = draw_profiles(of, "dynamic", 1, np.random.default_rng(3))
        samples = simulate(of, profiles, np.random.default_rng(4), network.lags)
        found = worst_case(network, of, 3, Effort(5, 1))
        bounds = load_model(shipped_model_path(DEFAULT_PRESET)).error_bounds
        return samples.inputs, found, error_bound_parts_K(network, bounds, samples, of)

    (inputs, *rest), (other_inputs, *other_rest) = made(preset), made(changed)
    assert np.array_equal(inputs, other_inputs)
    assert rest == other_rest


def test_a_lower_core_limit_changes_nothing_about_the_bound_and_a_higher_one_does(load):
    def found(limit_K):
        preset = load(("limits", "max_core_temperature_K"), limit_K)
        network = load_model(shipped_model_path(DEFAULT_PRESET)).network
        return preset.core_limit_of_bound_K, worst_case(network, preset, 1, Effort(5, 1)).value_K

    assert found(250.0) == found(323.0) > (323.0, 0.0)
    assert load(("limits", "max_core_temperature_K"), 323.1).core_limit_of_bound_K == 323.1


@dataclass(frozen=True)
class Before:
    """A part of a preset."""

    number: float


@dataclass(frozen=True)
class After(Before):
    """The same with fields that came later."""

    more: float | None = None
    names: list[str] = field(default_factory=list)


def test_a_field_that_comes_later_changes_a_hash_only_where_it_is_used():
    assert digest([Before(1.0)]) == digest([After(1.0)]) == digest([After(1.0, None, [])])
    used = {digest([After(1.0, more=0.0)]), digest([After(1.0, names=["x"])]), digest(Before(1.0))}
    assert len(used) == 3


def test_a_default_that_is_written_out_is_the_default(load):
    assert load().gains.alpha2_per_s is None
    assert replace(load(), gains=replace(load().gains, alpha2_per_s=None)).hash == load().hash
    assert load(("gains", "alpha2_per_s"), 0.03).hash != load().hash


BEYOND_THE_BUS = [
    (("limits", "reference_current_A"), -1048.58, "-1048.58", "-1048.576 to 1048.57"),
    (("operating_box", "current_A"), [-1048.58, 0.5], "-1048.58", "-1048.576 to 1048.57"),
    (("operating_box", "current_A"), [-24.0, 1048.58], "1048.58", "-1048.576 to 1048.57"),
    (("limits", "max_voltage_V"), 6.5534, "6.5534", "0 to 6.5533"),
    (("limits", "max_core_temperature_K"), 527.67, "527.67", "200 to 527.665"),
    (("limits", "max_surface_temperature_K"), 199.9, "199.9", "200 to 527.665"),
    (("initial", "temperature_K"), 199.9, "199.9", "200 to 527.665"),
    (("initial", "cooling_power_W"), 45.54, "45.54", "-20 to 45.533"),
    (("cell", "ocv", "voltage_V"), ..., "-0.1", "0 to 6.5533"),
    (("operating_box", "cooling_power_W"), [-20.1, 1.0], "-20.1", "-20 to 45.533"),
    (("operating_box", "surface_temperature_K"), [278.0, 528.0], "528", "200 to 527.665"),
    (("operating_box", "coolant_temperature_K"), [199.0, 324.0], "199", "200 to 527.665"),
]


@pytest.mark.parametrize(
    ("path", "value", "told", "carried"),
    BEYOND_THE_BUS,
    ids=names(row[0] for row in BEYOND_THE_BUS),
)
def test_what_does_not_fit_the_bus_is_refused_by_key_value_and_range(
    load, path, value, told, carried
):
    if value is ...:
        value = [-0.1, *at(CONTENT, path)[1:]]
    refusal = refused(load, path, value)
    assert refusal.endswith(
        f"{'.'.join(path)}: {told} does not fit the CAN signal, which carries {carried}"
    )


def test_ends_of_the_bus_s_ranges_fit(load):
    assert load(("operating_box", "current_A"), [-1048.576, 1048.57])
    assert load(("limits", "max_voltage_V"), 6.5533)
    assert load(("operating_box", "surface_temperature_K"), [200.0, 527.665])
    assert load(("operating_box", "cooling_power_W"), [-20.0, 45.533])


@pytest.mark.parametrize(
    ("key", "fits", "does_not"),
    [("reference_current_A", -699.0, -699.1), ("max_voltage_V", 5.95, 5.96)],
)
def test_a_limit_that_leaves_no_room_for_a_broken_sensor_is_refused(load, key, fits, does_not):
    """The bus would carry the end of its range, which the firmware would believe."""
    preset = load(("operating_box", "current_A"), [-1000.0, 1.0])
    plausibility_fields(replace(preset, limits=replace(preset.limits, **{key: fits})))
    with pytest.raises(InputError, match=rf"limits\.{key}: {does_not} leaves no room"):
        plausibility_fields(replace(preset, limits=replace(preset.limits, **{key: does_not})))


@given(bias=st.floats(-1.0, 1.0), noise=st.floats(0.0, 1.0), resolution=st.floats(0.0, 1.0))
def test_a_readings_error_bound_adds_bias_noise_and_rounding(bias, noise, resolution):
    sensor = type(load_preset("lin2014").sensors.current_A)(resolution, noise, bias)
    assert sensor.error_bound == pytest.approx(abs(bias) + 4.0 * noise + 0.5 * resolution)


@pytest.mark.parametrize("read", [read_toml, read_json])
def test_an_absent_file_is_told_once(tmp_path, read):
    path = tmp_path / "absent"
    with pytest.raises(InputError) as refusal:
        read(path)
    assert str(refusal.value) == f"{path}: no such file; check the path"
