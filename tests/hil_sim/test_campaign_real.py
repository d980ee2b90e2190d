"""A campaign over a preset's family: what is drawn, what is counted, and the run over the bus."""

from collections import Counter
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.stats import kstest

from bms.cell import CellFactors, Disturbance, integrate_step, scaled
from bms.errors import InputError
from bms.model.model_file import load_shipped_model
from bms.presets import load_preset
from hil_sim.commands import campaign as command
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.studies.campaign.noise import streams
from hil_sim.studies.campaign.real_draws import draw_real
from hil_sim.studies.campaign.real_summary import family_is_safe, summarise_family
from hil_sim.studies.campaign.rows import columns, header
from hil_sim.studies.campaign.settings import CampaignSettings, CellFamily, default_max_time_s
from hil_sim.studies.campaign.worker import run_chunk

PRESET = load_preset("a123_26650_10C")
INTERVAL = PRESET.cell.interval
RUNS = 1500
FULL_S = 10_800.0


def draw_of(run, preset=PRESET, seed=3):
    return draw_real(preset, FULL_S, streams(seed, run).draw)


@pytest.fixture(scope="module")
def draws():
    return [draw_of(run) for run in range(RUNS)]


@pytest.mark.parametrize("name", [field.name for field in fields(CellFactors)])
def test_every_factor_reaches_both_ends_and_is_uniform_between(draws, name):
    values = np.array([getattr(one.factors, name) for one in draws])
    low, high = {
        "relaxation": (1 / 1.5, 1.5),
        "entropic_error_V_per_K": (
            -INTERVAL.entropic_error_V_per_K,
            INTERVAL.entropic_error_V_per_K,
        ),
        "ocv_error_V": (-INTERVAL.ocv_error_V, INTERVAL.ocv_error_V),
    }.get(name) or getattr(INTERVAL, name)
    between = values[(values > low) & (values < high)]
    ends = Counter(values[(values <= low) | (values >= high)].tolist())
    assert set(ends) == {low, high}
    # An end in a quarter of the runs, and in all of those that are a whole vertex.
    assert len(between) / RUNS == pytest.approx(0.75 * 0.875, abs=0.04)
    assert kstest((between - low) / (high - low), "uniform").pvalue > 1e-3


def test_an_eighth_of_the_cells_is_a_vertex_of_the_whole_family(draws):
    ends = {
        name: interval for name, interval in vars(INTERVAL).items() if isinstance(interval, tuple)
    }
    corners = [
        all(getattr(one.factors, name) in interval for name, interval in ends.items())
        for one in draws
    ]
    assert np.mean(corners) == pytest.approx(0.125, abs=0.03)


def test_a_cell_is_the_nominal_one_with_its_factors(draws):
    for one in draws[:50]:
        assert one.cell.cell == scaled(PRESET.cell, one.factors)


def test_the_state_at_plug_in_is_off_by_no_more_than_the_preset_says(draws):
    plug_in, box, limits = PRESET.plug_in, PRESET.operating_box, PRESET.limits
    errors = []
    for cell in (one.cell for one in draws):
        state = cell.state
        assert 0.0 <= cell.plug_in_soc <= 0.9 and 0.0 <= state.soc <= 1.0
        errors.append(state.soc - cell.plug_in_soc)
        assert state.core_temperature_K <= limits.max_core_temperature_K
        assert state.surface_temperature_K <= limits.max_surface_temperature_K - 4.0
        assert (
            0.0 <= state.core_temperature_K - state.surface_temperature_K <= plug_in.core_excess_K
        )
        offset_K = state.coolant_temperature_K - state.surface_temperature_K
        assert abs(offset_K) <= plug_in.coolant_offset_K + 1e-9
        assert (
            box.coolant_temperature_K[0]
            <= state.coolant_temperature_K
            <= box.coolant_temperature_K[1]
        )
        assert 0.05 < cell.cooling_power_W <= box.cooling_power_W[1]
        assert box.coolant_temperature_K[0] < cell.coolant_floor_K
        assert cell.coolant_floor_K <= max(min(state.coolant_temperature_K - 1.0, 303.0), 267.0)
        assert abs(sum(cell.polarisation_V)) <= plug_in.polarisation_V + 1e-12
        for branch, voltage_V in zip(cell.cell.branches, cell.polarisation_V, strict=True):
            assert abs(voltage_V) <= 23.0 * branch.resistance_ohm + 1e-12
        assert abs(cell.supply_tolerance) <= PRESET.supply.tolerance
        assert 0.0 <= cell.supply_lag_s <= PRESET.supply.lag_s
    assert min(errors) == pytest.approx(-plug_in.soc_error) and max(errors) == pytest.approx(
        plug_in.soc_error
    )
    hot = np.mean(
        [one.cell.state.core_temperature_K > one.cell.state.surface_temperature_K for one in draws]
    )
    told = np.array([one.cell.plug_in_soc for one in draws])
    # A third has a hot core, but for those whose excess is at its lower end.
    assert hot == pytest.approx((1 - 0.16) / 3, abs=0.04)
    assert np.mean(told > 0.5) == pytest.approx(0.25, abs=0.04)
    assert set(Counter(one.disturbance for one in draws)) == set(DisturbanceKind) - {
        DisturbanceKind.NONE
    }


def test_biases_fill_what_the_sensors_bounds_leave():
    sensors = replace(
        PRESET.sensors,
        voltage_V=replace(PRESET.sensors.voltage_V, bias=-0.003),
        current_A=replace(PRESET.sensors.current_A, bias=0.0),
    )
    preset = replace(PRESET, sensors=sensors)
    biases = [draw_of(run, preset).cell.biases for run in range(200)]
    volts = [bias.voltage_V for bias in biases]
    assert (min(volts), max(volts)) == (-0.003, 0.003)
    assert all(bias.current_A == 0.0 for bias in biases)


def test_no_cell_is_drawn_that_crosses_its_limit_with_no_charger_at_all(draws):
    """At 0 A for three hours with the disturbance that heats most, by the cell model."""
    bounds = PRESET.uncertainty
    heating = Disturbance(0.0, bounds.core_K_per_s, bounds.surface_K_per_s, bounds.coolant_K_per_s)
    for one in sorted(draws, key=lambda one: -one.cell.state.coolant_temperature_K)[:5]:
        state = one.cell.state
        for _ in range(5400):
            state = integrate_step(
                one.cell.cell, state, 0.0, one.cell.cooling_power_W, 2.0, heating
            )
            assert max(state[1:3]) <= PRESET.limits.max_core_temperature_K + 1e-6


def test_a_run_is_the_same_whatever_ran_before(draws):
    assert draw_of(7) == draws[7]
    assert draw_of(7, seed=4) != draws[7]


def settings_of(runs, **changes):
    model = load_shipped_model(PRESET.name)
    return CampaignSettings(PRESET, model, runs, family=CellFamily.REAL, **changes)


def test_a_preset_without_intervals_is_refused_in_one_line():
    single = load_preset("lin2014")
    with pytest.raises(InputError, match=r"lin2014.*cell\.interval.*--family") as refusal:
        CampaignSettings(single, load_shipped_model("lin2014"), 1, family=CellFamily.REAL)
    assert "\n" not in str(refusal.value)


def row_of(**changes):
    """A firmware that did everything right."""
    row = dict.fromkeys(columns(CellFamily.REAL), "0")
    for name in ("kan_rcbf", "s_cbf", "cc_cv"):
        row |= {
            f"{name}_outcome": "complete",
            f"{name}_charge_time_s": "500.0",
            f"{name}_max_core_temperature_K": str(PRESET.limits.max_core_temperature_K),
            f"{name}_max_surface_temperature_K": str(PRESET.limits.max_surface_temperature_K),
            f"{name}_max_voltage_V": str(PRESET.limits.max_voltage_V),
            f"{name}_max_soc": "1.005",
            f"{name}_final_soc": "0.96",
        }
    return row | {"first_fault": ""} | {f"kan_rcbf_{key}": value for key, value in changes.items()}


@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ({"max_core_temperature_K": "323.0001"}, "core"),
        ({"max_surface_temperature_K": "323.0001"}, "surface"),
        ({"max_voltage_V": "3.600001"}, "voltage"),
        ({"max_soc": "1.00501"}, "soc"),
        ({"final_soc": "0.9599"}, "unfilled"),
        ({"outcome": "fault"}, "fault"),
        ({"outcome": "not-ready"}, "fault"),
    ],
)
def test_each_thing_that_goes_wrong_is_counted_and_fails_the_campaign(changes, kind):
    right = [row_of() | {"run": str(run)} for run in range(200)]
    assert family_is_safe(summarise_family(settings_of(200), right))
    rows = [*right[:-1], row_of(**changes) | {"run": "199"}]
    summary = summarise_family(settings_of(200), rows)
    violations = summary["controllers"]["kan-rcbf"]["violations"]
    assert {name: v["count"] for name, v in violations.items() if v["count"]} == {kind: 1}
    assert [worst["run"] for worst in violations[kind]["worst"]] == [199]
    assert not family_is_safe(summary)


@pytest.mark.parametrize(("late", "is_safe"), [(2, True), (3, False)])
def test_99_of_100_charges_have_to_be_complete_in_time(late, is_safe):
    rows = [row_of(outcome="time-limit" if run < late else "complete") for run in range(200)]
    assert family_is_safe(summarise_family(settings_of(200), rows)) is is_safe


def test_a_charge_has_the_time_that_the_weakest_current_of_the_map_takes():
    """A tenth of its current at 0 degC fills this cell in eight hours, whatever controls it."""
    slow, fast = load_preset("samsung_30q"), load_preset("a123_26650_10C")
    assert slow.current_map is not None
    weakest_A = min(map(min, slow.current_map.largest_A))
    hours = slow.cell.interval.capacity[1] * slow.cell.capacity_Ah / weakest_A
    assert default_max_time_s(slow, CellFamily.REAL) == pytest.approx(1.1 * 3600.0 * hours, abs=1.0)
    assert default_max_time_s(slow, CellFamily.PUBLISHED) == 3600.0
    assert default_max_time_s(fast, CellFamily.REAL) == 10_800.0


def test_what_counts_as_a_stop_is_a_command_of_0_A_after_a_current():
    summary = summarise_family(
        settings_of(3), [row_of(stops="0"), row_of(stops="4"), row_of(stops="1")]
    )
    stops = summary["controllers"]["kan-rcbf"]["stops"]
    assert (stops["runs"], stops["total"], [w["by"] for w in stops["worst"]]) == (2, 5, [4.0, 1.0])


def test_a_campaign_prints_its_worst_runs_and_says_by_its_exit_code_what_it_found(tmp_path, capsys):
    code = command.campaign(
        runs=6, jobs=1, preset=PRESET.name, family=CellFamily.REAL, max_time_s=30.0, out=tmp_path
    )
    assert code == 1, "nothing is full after 30 s"
    assert "6 cells of the preset's family" in capsys.readouterr().out
    lines = (tmp_path / "runs.csv").read_text().splitlines()
    assert lines[0] + "\n" == header(CellFamily.REAL)
    assert len(lines) == 7
    assert run_chunk(settings_of(6, max_time_s=30.0), range(2, 3)).strip() == lines[3]
