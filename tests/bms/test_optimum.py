"""The lower bound on the time to full: no charge beats it, some come close, poor prices keep it.

The oracles are charges that are played with the cell model, which knows nothing of the relaxation,
and a linear program of another solver with another discretisation.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import bmat, coo_matrix, csr_matrix, diags, hstack, identity, vstack

from bms.cell import Branch, EntropyTable, ResistanceTable
from bms.errors import InputError
from bms.presets import load_preset, preset_names
from bms.presets.optimum import charge_digest, known_bound
from bms.presets.schema import CurrentMap
from bms.studies.optimum.bound import SAMPLES, lower_bound
from bms.studies.optimum.certificate import most_charge_As
from bms.studies.optimum.charge import charge_of
from bms.studies.optimum.multipliers import Multipliers
from bms.studies.optimum.program import solve
from bms.studies.optimum.ranges import map_current_A, map_planes, ranges_of, voltage_lines
from bms.studies.optimum.relaxation import relax
from bms.studies.optimum.riding import best_constant, best_following
from tests.bms.optimum_samples import STEP_S, full_at_its_end, strongest_courses

pytest.importorskip("cvxpy")
pytestmark = pytest.mark.slow

COARSE_S = 0.4
"""Step of charges that are played, where a fraction of a per cent does not matter."""
HOT = ("lin2014", 313.0, 0.5)


def hot_charge():
    """Short, and limited by the core: the case in which planning matters most."""
    name, start_K, soc = HOT
    return charge_of(load_preset(name), start_K, soc)


@pytest.fixture(scope="module")
def hot():
    """Physics alone: charge, bound with 100 samples."""
    charge = hot_charge().physics_alone()
    return charge, lower_bound(charge, 100)


def certified_As(charge, duration_s, samples, points=8):
    relaxation = relax(charge, duration_s, samples)
    return most_charge_As(relaxation, solve(relaxation).multipliers, points)


def test_a_played_charge_lies_above_the_bound_and_within_one_percent(hot):
    charge, bound = hot
    constant = best_constant(charge, COARSE_S)
    following = best_following(charge, bound, COARSE_S)
    assert bound.time_s < following.time_s < 1.01 * bound.time_s
    assert bound.time_s < constant.time_s < 1.10 * bound.time_s


def test_ramp_only_makes_it_later_and_a_charge_with_the_ramp_comes_as_close(hot):
    charge, _ = hot_charge(), hot
    bound = lower_bound(charge, 100)
    # From 0 A to the strongest current of the plan at 2.3 A/s, half of which time is lost.
    assert hot[1].time_s + 1.0 < bound.time_s < hot[1].time_s + 10.0
    assert bound.time_s < best_following(charge, bound, COARSE_S).time_s < 1.01 * bound.time_s


def linear_program_As(charge, duration_s, samples):
    """Largest charge by HiGHS: tangents below u^2, implicit Euler, plain planes for E Tc u."""
    step_s, cell, limits = duration_s / samples, charge.cell, charge.limits
    n, one, none = samples, identity(samples), csr_matrix((samples, samples))
    before = diags([np.ones(n - 1)], [-1], shape=(n, n))
    # Unknowns: current, heat, rise of core, surface and coolant at the ends of the steps.
    dynamics, heating, cooling = charge.dynamics, charge.heating, charge.cooling
    equal = [
        [none, -step_s * heating[i] * one, *(-step_s * dynamics[i, j] * one for j in range(3))]
        for i in range(3)
    ]
    for i in range(3):
        equal[i][2 + i] = equal[i][2 + i] + one - before
    reversible_V = cell.entropic_coefficient_V_per_K * limits.max_core_temperature_K
    assert reversible_V < 0.0
    rows, most = [], []
    for at_A in np.linspace(0.0, charge.strongest_A, 60):
        slope = 2.0 * cell.ohmic_resistance_ohm * at_A + reversible_V
        rows.append(hstack([slope * one, -one, none, none, none]))
        most.append(np.full(n, cell.ohmic_resistance_ohm * at_A**2))
    summed = coo_matrix(np.tril(np.ones((n, n)))) * (step_s / cell.capacity_As)
    for constant, slope in voltage_lines(cell, (charge.start_soc, 1.0)):
        held = slope * (summed - 0.5 * step_s / cell.capacity_As * one)
        rows.append(hstack([held + cell.ohmic_resistance_ohm * one, *[none] * 4]))
        most.append(np.full(n, limits.max_voltage_V - constant - slope * charge.start_soc))
    rises = (limits.max_core_temperature_K, limits.max_surface_temperature_K, 1e3)
    answer = linprog(
        np.concatenate([-np.full(n, step_s), np.zeros(4 * n)]),
        A_ub=vstack(rows),
        b_ub=np.concatenate(most),
        A_eq=bmat(equal),
        b_eq=np.repeat(step_s * cooling, n),
        bounds=[(0.0, charge.strongest_A)] * n
        + [(None, None)] * n
        + [(None, rise - charge.start_K) for rise in rises for _ in range(n)],
        method="highs",
    )
    assert answer.status == 0
    return -answer.fun


def test_a_linear_program_of_another_solver_finds_the_same_largest_charge(hot):
    charge, bound = hot
    other_As = linear_program_As(charge, bound.time_s, 200)
    assert other_As == pytest.approx(charge.needed_As, rel=0.01)


def test_finer_samples_lower_the_certified_charge_towards_a_limit(hot):
    charge, bound = hot
    coarse, middle, fine = (certified_As(charge, bound.time_s, n) for n in (40, 80, 160))
    assert coarse > middle > fine
    # The error goes with the square of the sample, so that each halving leaves a quarter of it.
    assert middle - fine < 0.4 * (coarse - middle)
    # What is left below 160 samples is worth less than 0.1 % of the charge.
    assert middle - fine < 1e-3 * charge.needed_As


def test_the_quadrature_is_no_part_of_the_bound(hot):
    charge, bound = hot
    relaxation = relax(charge, bound.time_s, 80)
    prices = solve(relaxation).multipliers
    rough, fine = (most_charge_As(relaxation, prices, points) for points in (8, 64))
    assert rough == pytest.approx(fine, rel=2e-6)


def other_cells():
    """Charges in which one part of a cell or preset governs, and how close the bound must be."""
    charge = hot_charge().physics_alone()
    cell, flat = charge.cell, (0.0, 1.0)
    yield "branches", replace(cell, branches=(Branch(0.006, 15.0),)), None, 1.01
    yield "heats by entropy", replace(cell, entropic_coefficient_V_per_K=2e-4), None, 1.01
    rising = EntropyTable(flat, (-1e-4, 1e-4))
    yield "entropy over SoC", replace(cell, entropy=rising), None, 1.03
    falling = ResistanceTable((310.0, 325.0), flat, ((0.0124, 0.0124), (0.0110, 0.0110)))
    yield "resistance over temperature", replace(cell, resistance=falling), None, 1.03
    by_warmth = CurrentMap((310.0, 330.0), flat, ((6.0, 6.0), (26.0, 26.0)))
    yield "map that warmth opens", cell, by_warmth, 1.05
    by_charge = CurrentMap((300.0, 330.0), (0.5, 1.0), ((20.0, 4.0), (20.0, 4.0)))
    yield "map that charge closes", cell, by_charge, 1.01


@pytest.mark.parametrize(
    ("cell", "current_map", "within"),
    [pytest.param(*rest, id=name) for name, *rest in other_cells()],
)
def test_with_each_part_of_a_cell_the_bound_lies_closely_below_a_played_charge(
    cell, current_map, within
):
    charge = replace(hot_charge().physics_alone(), cell=cell, current_map=current_map)
    bound = lower_bound(charge, 60)
    following = best_following(charge, bound, COARSE_S)
    assert bound.time_s < following.time_s < within * bound.time_s


def test_the_fastest_charge_that_a_map_allows_is_on_the_edge_of_the_ranges():
    current_map = CurrentMap((280.0, 330.0), (0.0, 1.0), ((22.0, 2.0), (22.0, 2.0)))
    charge = replace(hot_charge().physics_alone(), start_K=290.0, current_map=current_map)
    # At 22 - 20 s the state of charge is 1.1 - (1.1 - s0) exp(-20 t/C), from ds/dt = I/C.
    per_s = 20.0 / charge.cell.capacity_As
    duration_s = np.log((1.1 - charge.start_soc) / (1.1 - 0.99)) / per_s
    ranges = ranges_of(charge, duration_s, 40)
    ends_s = ranges.step_s * np.arange(41)
    exact = 1.1 - (1.1 - charge.start_soc) * np.exp(-per_s * ends_s)
    low, high = ranges.soc
    assert np.all(low <= exact[:-1]) and np.all(exact[1:] <= high)
    assert low == pytest.approx(exact[:-1], abs=0.01)
    assert high == pytest.approx(exact[1:], abs=0.01)


SHORT_S = 120.0
"""Duration of the charges that are played; they are full where they end, so the proof must admit
each of them."""
STARTS = {
    "lin2014": (316.0, 0.3),
    "paper_calibrated": (317.0, 0.5),
    "a123_26650_10C": (316.0, 0.4),
    "a123_26650": (303.0, 0.3),
}


def varied(prices, rng):
    """Prices that nobody optimised: each times a random factor, some moved to other samples."""
    spread = rng.choice([0.01, 0.3, 2.0])

    def times(values):
        return values * np.exp(rng.normal(0.0, spread, values.shape))

    return Multipliers(
        core=np.roll(times(prices.core), rng.integers(0, 3)),
        surface=times(prices.surface) + rng.choice([0.0, 1e-2]),
        voltage=times(prices.voltage) + rng.choice([0.0, 1e-2]),
        current_map=times(prices.current_map),
        ramp=np.concatenate([times(prices.ramp[:-1]), [0.0]]),
        core_share=rng.uniform(0.0, 1.0, len(prices.core_share)),
        polarisation_V=times(prices.polarisation_V),
    )


@pytest.fixture(scope="module", params=sorted(STARTS))
def courses(request):
    """Charges of a preset, with its ramp and map and without; courses that keep their limits."""
    whole = charge_of(load_preset(request.param), *STARTS[request.param])
    with_courses = []
    for charge in (whole, whole.physics_alone()):
        found = list(strongest_courses(charge, SHORT_S))
        assert found
        with_courses += [(full_at_its_end(charge, course), course) for course in found]
    return with_courses


def test_whatever_the_prices_a_charge_that_was_played_is_not_larger_than_certified(courses):
    rng = np.random.default_rng(7)
    for charge, course in courses[::2]:
        relaxation = relax(charge, SHORT_S, 24)
        prices = solve(relaxation).multipliers
        played_As = (course.soc[-1] - course.soc[0]) * charge.cell.capacity_As
        certified = [most_charge_As(relaxation, prices)]
        certified += [most_charge_As(relaxation, varied(prices, rng)) for _ in range(6)]
        assert played_As <= min(certified)


def test_a_charge_that_was_played_stays_in_the_ranges(courses):
    for charge, course in courses:
        ranges = ranges_of(charge, SHORT_S, 24)
        sample = np.minimum((STEP_S * np.arange(len(course.soc)) / ranges.step_s).astype(int), 23)
        table, entropy = charge.cell.resistance, charge.cell.entropy
        quantities = [
            (course.soc, ranges.soc),
            (course.core_K, ranges.core_K),
            (course.surface_K, ranges.surface_K),
        ]
        if table is not None:
            quantities.append((table(course.core_K, course.soc), ranges.resistance_ohm))
        if entropy is not None:
            quantities.append((entropy(course.soc), ranges.entropic_V_per_K))
        for values, (low, high) in quantities:
            assert np.all(low[sample] - 1e-9 <= values)
            assert np.all(values <= high[sample] + 1e-9)
        assert np.all(course.current_A <= ranges.strongest_A[sample[:-1]] + 1e-9)


def test_tables_that_hold_one_value_are_the_constant():
    charge = hot_charge()
    cell = charge.cell
    ohm, entropic = cell.ohmic_resistance_ohm, cell.entropic_coefficient_V_per_K
    tables = replace(
        cell,
        resistance=ResistanceTable((280.0, 320.0), (0.0, 1.0), ((ohm, ohm), (ohm, ohm))),
        entropy=EntropyTable((0.0, 1.0), (entropic, entropic)),
    )
    as_constant, as_table = (
        certified_As(replace(charge, cell=one), 205.0, 30) for one in (cell, tables)
    )
    assert as_table == pytest.approx(as_constant, rel=1e-6)


def test_envelopes_of_voltage_and_map_lie_below_and_above():
    preset, rng = load_preset("a123_26650"), np.random.default_rng(3)
    for _ in range(20):
        low, high = np.sort(rng.uniform(0.0, 1.0, 2))
        cold, hot = np.sort(rng.uniform(270.0, 330.0, 2))
        soc, surface_K = rng.uniform(low, high, 200), rng.uniform(cold, hot, 200)
        lines_V = np.max(voltage_lines(preset.cell, (low, high)) @ [np.ones(200), soc], axis=0)
        assert np.all(lines_V <= preset.cell.ocv(soc) + 1e-12)
        planes = map_planes(preset.current_map, (cold, hot), (low, high))
        planes_A = np.min(planes @ [np.ones(200), surface_K, soc], axis=0)
        assert np.all(planes_A >= map_current_A(preset.current_map, surface_K, soc) - 1e-9)


def test_the_map_and_the_voltage_touch_their_envelopes_where_they_bend_the_right_way():
    preset = load_preset("a123_26650")
    lines = voltage_lines(preset.cell, (0.95, 1.0))
    for soc in (0.95, 0.98, 0.995, 1.0):
        assert np.max(lines @ [1.0, soc]) == pytest.approx(float(preset.cell.ocv(soc)), abs=2e-3)
    planes = map_planes(preset.current_map, (298.15, 308.15), (0.4, 0.6))
    assert np.min(planes @ [1.0, 308.15, 0.4]) == pytest.approx(10.0, abs=1e-6)
    assert np.min(planes @ [1.0, 298.15, 0.6]) == pytest.approx(4.6, abs=1e-6)


def test_every_shipped_preset_has_a_known_bound():
    for name in preset_names():
        known = known_bound(load_preset(name))
        assert known is not None, "its cell, limits or start changed: python -m bms.studies.optimum"
        assert known.optimum_time_s <= known.lower_bound_s


def test_a_known_bound_is_what_the_program_certifies_and_no_more():
    preset = load_preset("lin2014")
    charge, known = charge_of(preset), known_bound(preset)
    assert certified_As(charge, known.lower_bound_s - 0.1, SAMPLES) < charge.needed_As
    assert certified_As(charge, known.lower_bound_s + 0.2, SAMPLES) > charge.needed_As


def test_another_start_limit_or_map_has_no_known_bound_and_other_gains_have():
    preset = load_preset("lin2014")
    others = [
        replace(preset, initial=replace(preset.initial, soc=0.2)),
        replace(preset, limits=replace(preset.limits, max_core_temperature_K=322.0)),
        replace(preset, cell=replace(preset.cell, capacity_Ah=2.2)),
        replace(preset, current_map=load_preset("a123_26650").current_map),
    ]
    assert [known_bound(other) for other in others] == [None] * len(others)
    gains = replace(preset.gains, alpha1_per_s=0.06)
    assert charge_digest(replace(preset, gains=gains)) == charge_digest(preset)


def test_a_start_that_leaves_nothing_to_charge_or_is_too_hot_is_refused():
    preset = load_preset("lin2014")
    with pytest.raises(InputError, match=r"state of charge 0\.99 at the start"):
        charge_of(preset, start_soc=0.99)
    with pytest.raises(InputError, match=r"start at 323\.5 K"):
        charge_of(preset, start_K=323.5)
    with pytest.raises(InputError, match="cooling of -1 W"):
        charge_of(preset, cooling_W=-1.0)
