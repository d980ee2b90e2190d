"""Safety claims broken on purpose in the C sources: each must turn its own tests red.

The named tests run against each mutant in a process of their own. A mutant that survives is a
claim that nothing checks.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.firmware.mutants.forks import run_tests
from tests.firmware.mutation import CompiledFirmware


@dataclass(frozen=True)
class Mutant:
    """One replacement in one source, and the tests that must notice it."""

    claim: str
    source: str
    old: str
    new: str
    tests: str
    only: str = ""


DECISION, STATES = "tests/firmware/test_rcbf.py", "tests/firmware/test_ecu_states.py"
HISTORY, THERMAL = "tests/firmware/test_history.py", "tests/firmware/test_thermal.py"
FAULTS, ESTIMATE = "tests/firmware/test_ecu_faults.py", "tests/firmware/test_kan.py"
NETWORK, PROTECTION = "tests/firmware/test_supervision.py", "tests/firmware/test_e2e.py"
PLANNED = "tests/firmware/test_planner.py"
PLANNED_FAMILY = "tests/firmware/test_planner_family.py"
SMOOTH = "tests/firmware/test_smooth_command.py"
NO_NUMBER, PACE = "tests/firmware/test_no_number.py", "tests/firmware/test_pace.py"
MARGINS = "names_the_constraint"

MUTANTS = [
    Mutant("core disturbance is subtracted", "rcbf.c", "(k->core_uncertainty_K_per_s + k->", "(k->", DECISION, MARGINS),
    Mutant("core margin is subtracted", "rcbf.c", " + k->core_margin_K_per_s)", ")", DECISION, MARGINS),
    Mutant("surface margin counts", "rcbf.c", " + k->surface_margin_K_per_s2)", ")", DECISION, MARGINS),
    Mutant("estimation error is taken at its worst", "rcbf.c", "f->mean.constant + f->rest", "f->mean.constant - f->rest", DECISION, MARGINS),
    Mutant("temperatures are finer than float32", "rcbf.c", " + (a.low_K - b.low_K)", "", DECISION, "more_digits"),
    Mutant("voltage limit decides", "rcbf.c", "k->max_voltage_V - open_circuit", "k->max_voltage_V + open_circuit", DECISION, MARGINS),
    Mutant("an empty interval gives 0 A", "rcbf.c", "decision.feasible ? interval.lower_A : 0.0f", "interval.lower_A", DECISION, "infeasible"),
    Mutant("a constraint that may decide is solved", "rcbf.c", "#define CLEARLY 1e-5f", "#define CLEARLY -1e-2f", DECISION, "just_decides"),
    Mutant("not a number is refused", "rcbf.c", "if (!is_physical(input))", "if (input->reference_current_A > 0.0f)", DECISION, "no_number"),
    Mutant("an end that is no number leaves nothing", "rcbf.c", "if (!(lower_A <= to->lower_A))", "if (lower_A > to->lower_A)", NO_NUMBER),
    Mutant("an end that is no number stays", "rcbf.c", "(lower_A <= FLT_MAX) ? lower_A : FLT_MAX", "lower_A", NO_NUMBER),
    Mutant("steps are held against the measurements", "pace.c", "((int32_t)measured_periods - 1)", "0", PACE, "one_more"),
    Mutant("extrapolation is flagged", "kan.c", "in_domain = false;", "in_domain = true;", ESTIMATE, "flagged"),
    Mutant("combinations never seen are flagged", "kan.c", "!is_in_slabs(model, nodes)", "false", ESTIMATE, "combination"),
    Mutant("filters are trusted only when settled", "history.c", "history->periods >= model->settling_periods", "history->periods >= 0u", HISTORY, "init_until"),
    Mutant("an ECU with memory waits in init", "bms.c", "if (history_is_settling(", "if (!history_is_settling(", HISTORY, "init_until"),
    Mutant("faults are seen while filters settle", "bms.c", "symptoms & ~bit_if(true, FAULT_OUT_OF_DOMAIN)", "0u", HISTORY, "faults_are_seen"),
    Mutant("a gap starts the history anew", "history.c", "bridged > HISTORY_MAX_BRIDGED", "bridged > 9999u", HISTORY, "gap"),
    Mutant("filters are deaf to what is no number", "history.c", "is_usable && numeric_is_finite(current_A) &&", "is_usable ||", HISTORY, "bridged"),
    Mutant("a surface colder than the heat allows is a fault", "bms_symptoms.c", "limits->surface_deficit_K),", "9999.0f),", FAULTS, "colder"),
    Mutant("the prediction warms with the current", "thermal.c", "constants->gain_K_per_W[0] * heat_W", "0.0f * heat_W", THERMAL, "undisturbed"),
    Mutant("the prediction's error is granted", "thermal.c", " - constants->error_bound_K", "", THERMAL, "within_the_modelled"),
    Mutant("the heat stands in for a sensor that reads cold", "bms.c", "bms->surface_temperature_K = least_K;", "(void)0;", STATES, "stands_in"),
    Mutant("a latched fault ends the charge", "bms.c", "bms->state = BMS_FAULT;\n    }\n    const", "bms->state = bms->state;\n    }\n    const", FAULTS, "stops_the_charge"),
    Mutant("a symptom stops at once", "bms.c", "!bms->monitor.stop &&", "", FAULTS, "stops_the_charge"),
    Mutant("silence is noticed", "e2e.c", "receiver->is_good = false;", "(void)0;", FAULTS, "lost"),
    Mutant("the CRC is checked", "e2e.c", "if (data[0] != e2e_crc(data, length, data_ids))", "if (length == 0u)", FAULTS, "corrupted_byte"),
    Mutant("the counter is checked", "e2e.c", "(steps == 0u) ||", "(steps == 99u) ||", FAULTS, "masquerader"),
    Mutant("what is not valid is not used", "e2e.c", "receiver->is_good && (receiver->state == E2E_VALID)", "receiver->is_good", NETWORK, "every_other or before_they"),
    Mutant("a message often damaged loses trust", "e2e.c", "&& (bad <= policy->valid.max_bad)", "", NETWORK, "beside_good"),
    Mutant("trust has to be won back", "e2e.c", "(good >= policy->invalid.min_good)", "receiver->is_good", NETWORK, "every_other"),
    Mutant("a frame that comes late is refused", "e2e.c", "else if (steps <= max_delta_counter)", "else if (steps <= 15u)", PROTECTION, "comes_late"),
    Mutant("counts do not wrap", "e2e.c", "(frames < room) ? frames : room", "frames", PROTECTION, "maximum"),
    Mutant("a count is its own message's", "bms.c", "receivers[reported].counts", "receivers[0].counts", NETWORK, "its_message_and_kind"),
    Mutant("a reading not available keeps its own name", "bms.c", "!monitor_stops(symptoms) && is_charging(bms)", "is_charging(bms)", FAULTS, "is_named"),
    Mutant("codes do not wrap", "codec.c", "(value < all_ones) ? value : all_ones", "value", "tests/firmware/test_codec_messages.py", "reads_back"),
    Mutant("the reference has a ceiling", "bms_growth.c", "numeric_larger(calibration->reference_current_A,", "(", STATES, "reference"),
    Mutant("growth is limited", "bms_growth.c", "bms->command_A - bms->growth_A", "bms->command_A - 99.0f", STATES, "grows"),
    Mutant("a weaker request is obeyed at once", "bms_growth.c", "numeric_larger(planned_A, asked_A)", "planned_A", STATES, "at_once"),
    Mutant("current rises slowly after a limit", "bms_growth.c", "= LEAST_GROWTH * growth_A", "= growth_A", SMOOTH, "rises_slowly"),
    Mutant("later requests are followed gently", "bms_growth.c", "        bms->growth_A = most_A;\n", "        (void)0;\n", SMOOTH, "follows_later"),
    Mutant("a steadied condition is no more than the reading's", "rcbf.c", "if (!(*kept <= f->constant))", "if (!(*kept <= f->constant + margin))", SMOOTH, "no_stronger"),
    Mutant("a steadied condition gives way after no number", "rcbf.c", "if (!(*kept <= f->constant))", "if (*kept > f->constant)", SMOOTH, "no_number"),
    Mutant("a steadied voltage is no less than the reading", "family_observer.c", "if (!(steady_V >= read_V))", "if (steady_V != steady_V)", SMOOTH, "believes_no_less"),
    Mutant("a reading below the prediction is not believed", "bms.c", ": thermal_predicted_surface_K(&bms->thermal)", ": thermal_coldest_surface_K(&bms->thermal, &calibration->thermal)", "tests/hil_sim/test_surface_sensor.py", "slow_drift"),
    Mutant("a charge needs the edge", "bms.c", "bms->may_start && (symptoms", "(symptoms", STATES, "edge"),
    Mutant("a charge ends when complete", "bms.c", "bms->state = BMS_COMPLETE;", "bms->state = BMS_CHARGING;", STATES, "complete"),
    Mutant("the command is counted too", "soc.c", "? state->commanded.soc", "? state->measured.soc", STATES, "counted"),
    Mutant("a fault outlives its symptom", "monitor.c", "monitor->latched |= BIT(fault);", "monitor->latched = BIT(fault) & monitor->active;", FAULTS, "whatever_other"),
    Mutant("commands are rounded towards zero", "codec.c", "(rounding == CODEC_TOWARDS_ZERO) ? STEP_TOLERANCE : 0.5f", "0.5f", "tests/firmware/test_codec.py", "towards_zero"),
    Mutant("a plan only weakens", "planner.c", "((planned_A > reference_A) && (planned_A <= 0.0f))", "(planned_A <= 0.0f)", PLANNED, "never_more"),
    Mutant("a plan asks for no discharge", "planner.c", " && (planned_A <= 0.0f))", ")", PLANNED, "never_more"),
    Mutant("a plan needs numbers", "planner.c", "if (!is_known(planner))", "if (planner->goal.strongest_A < 0.0f)", PLANNED, "no_number"),
    Mutant("a period's steps are bounded", "planner.c", " && (i < PLANNER_STEPS); i++", "; i++", PLANNED, "takes_no_more"),
    Mutant("the better half is searched on", "planner.c", "inner[0].cost < inner[1].cost", "inner[0].cost > inner[1].cost", PLANNED, "near_the_bound"),
    Mutant("limits are ridden in the prediction", "planner.c", "numeric_smaller(soc_A, numeric_smaller(core_A, surface_A))", "soc_A", PLANNED, "comes_true"),
    Mutant("the coolant warms up", "planner.c", "row[COOLANT] * planner->temperature_K[COOLANT] +", "row[COOLANT] * planner->start.temperature_K[COOLANT] +", PLANNED, "comes_true or near_the_bound"),
    Mutant("the plan in force is tried too", "planner.c", "if (planned_A > planner->low_A)", "if (planned_A < 0.0f)", PLANNED, "until_a_better"),
    Mutant("a step has the voltage of its middle", "planner.c", "planner->soc + 0.5f * constants", "planner->soc + 0.0f * constants", PLANNED, "comes_true"),
    Mutant("a family's charge is in the middle", "bms_plan.c", "0.5f * (family->soc_low.soc + family->soc_high.soc)", "family->soc_low.soc", PLANNED_FAMILY, "comes_true"),
    Mutant("a family's resistance falls with warmth", "planner.c", "(family->is_stated != 0u) ? (family_res", "(family->is_stated == 2u) ? (family_res", PLANNED_FAMILY, "comes_true"),
    Mutant("in time is better than soon", "planner.c", "(candidate->strength_A + IN_TIME)", "(IN_TIME - candidate->strength_A)", PLANNED, "by_time"),
    Mutant("the fixed mode is not planned", "bms_plan.c", "(mode == MODE_FASTEST) || (mode == MODE_BY_TIME)", "mode <= MODE_FIXED", "tests/firmware/test_charge_mode.py", "wants_none"),
    Mutant("a mode that is gone is not obeyed", "bms_plan.c", "is_valid(bms, CAN_RECEIVED_CHARGE_MODE) ?", "true ?", PLANNED, "goes_away"),
    Mutant("a family's plan ends with its least charge", "bms_plan.c", "start->soc = family->soc_low.soc;", "", PLANNED_FAMILY, "full_in_time"),
    Mutant("heat without current is no resistance", "bms_plan.c", "/ most_A, greatest_ohm);", "/ most_A, 1e9f);", PLANNED_FAMILY, "pause"),
    Mutant("another goal is planned at once", "bms_plan.c", "if (is_other_goal(bms))", "if (is_other_goal(bms) && (bms->periods == 0u))", PLANNED_FAMILY, "another_goal"),
]  # fmt: skip


@pytest.fixture(scope="module")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> CompiledFirmware:
    return CompiledFirmware.build(tmp_path_factory.mktemp("firmware"))


@pytest.mark.slow
@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.claim)
def test_broken_claim_is_noticed(
    mutant: Mutant, firmware: CompiledFirmware, tmp_path: Path
) -> None:
    build = firmware.variant(mutant.source, mutant.old, mutant.new, tmp_path / "out")
    result = run_tests(build, ["-x", mutant.tests, "-k", mutant.only], tmp_path / "output")
    assert result.code == 1, f"survived: {mutant.claim}\n{result.output[-2000:]}"
