"""What `bms bench` says of a figure's parts: they add up to it, and every missed aim has some."""

import itertools
import json
import os
import shutil

import pytest

from bms.errors import InputError
from bms.presets import DEFAULT_PRESET
from hil_sim.studies.bench.aims import aims
from hil_sim.studies.bench.board import board_flash
from hil_sim.studies.bench.breakdown import REST, grouped, parts_with_rest
from hil_sim.studies.bench.campaign_parts import (
    CELL_PART,
    FIRMWARE_PART,
    NOISE_PART,
    WATCH_PART,
    CampaignParts,
    campaign_parts,
)
from hil_sim.studies.bench.counted import instructions_of_period, own_costs
from hil_sim.studies.bench.limits import FUNCTIONS, MODULES, breakdowns
from hil_sim.studies.bench.machine import this_machine
from hil_sim.studies.bench.problem import charge_problem
from hil_sim.studies.bench.race import Quartiles, Timed
from hil_sim.studies.bench.run import Result
from hil_sim.studies.bench.simulation import BusSpeed
from hil_sim.studies.bench.throughput import Throughput

HAS_VALGRIND = shutil.which("valgrind") or "CI" in os.environ
CALLGRIND = """\
# callgrind format
positions: line
events: Ir
fn=(1) bms_step
10 5
+2 7
cfn=(2) kan_evaluate
calls=3 20
+1 900
* 1

fn=(2)
fi=(4) numeric.h
20 40
fe=(3)
-1 2
"""


def test_cost_of_a_called_function_counts_for_that_alone():
    assert list(own_costs(CALLGRIND.splitlines())) == [
        *(("bms_step", count) for count in (5, 7, 1)),
        *(("kan_evaluate", count) for count in (40, 2)),
    ]


def test_rest_is_what_the_parts_leave_and_may_be_below_zero():
    assert parts_with_rest(10.0, {"a": 2.0, REST: 99.0, "b": 5.0}) == {
        "b": 5.0,
        "a": 2.0,
        REST: 3.0,
    }
    assert parts_with_rest(1.0, {"a": 1.5})[REST] == -0.5


def test_a_name_belongs_to_the_first_group_that_it_begins_like():
    groups = {"plan": ("bms_plan",), "states": ("bms_",), "none": ("x",)}
    counts = {"bms_plan": 1.0, "bms_step": 2.0, "bms_planned": 4.0, "main": 8.0}
    assert grouped(counts, groups) == {"plan": 5.0, "states": 2.0, REST: 8.0}


def missed_result() -> Result:
    """A result that misses every aim which has parts."""
    slow = Quartiles(1.0, 1.0, 1.0, 3)
    layers = {"cell model": 60.0, "rest": 40.0}
    result = Result(
        this_machine(),
        period=[Timed("control period in C", "x 1", Quartiles(500.0, 1.0, 1.0, 3), 1, 0.0)],
        period_instructions={"planner_step": 600.0, "kan_evaluate": 400.0},
        simulation=[
            BusSpeed("virtual:x", 1, "one process", 10, slow, 100.0, layers),
            BusSpeed("socketcan:vcan0", 2, "two processes", 10, slow, 100.0, layers),
        ],
        campaign=[Throughput(100, 1, 10.0, 10.0)],
        campaign_parts=CampaignParts(
            3, 100.0, {"firmware, its frames and its readings": 30.0, "cells": 60.0}, 20_000.0
        ),
    )
    result.board = [board_flash(board) for board in ("mps2-an385", "mps2-an386")]
    return result


def test_every_missed_aim_has_parts_that_add_up_to_it():
    result = missed_result()
    missed = {aim.name for aim in aims(result) if not aim.is_reached}
    assert len(missed) == 6
    found = {one.figure: one for one in breakdowns(result)}
    assert missed == set(found)
    for one in found.values():
        assert one.total == pytest.approx(one.measured, rel=1e-9)
        assert one.wanted < one.measured
        assert REST in one.parts
        assert one.limit
    assert found["simulation on virtual:x, one process"].parts["cell model"] == 0.6 * 100_000.0
    assert "had a core for 100000 us" in found["simulation on virtual:x, one process"].limit
    # 1,000 instructions in 500 ns; 250 ns are half of them.
    assert found["control period with frames in C"].wanted == pytest.approx(500.0)


def test_a_board_s_flash_is_all_given_to_what_it_is_for():
    """A module that no group names would be in the rest, which the reader could not judge."""
    flash = [one for one in breakdowns(missed_result()) if one.figure.startswith("flash")]
    assert len(flash) == 2
    for one in flash:
        assert set(one.parts) == {*MODULES, REST}
        assert one.parts[REST] == 0.0
        assert one.parts["planner"] > 0.0 < one.parts["family of cells"]


@pytest.mark.skipif(not HAS_VALGRIND, reason="not run: needs valgrind")
def test_instructions_of_a_period_are_the_same_each_time_and_have_their_groups():
    problem = charge_problem(DEFAULT_PRESET, 20.0)
    counts = instructions_of_period(problem)
    assert counts == instructions_of_period(problem)
    assert counts["kan_evaluate"] > 100.0
    assert counts["e2e_crc"] > 100.0
    groups = grouped(counts, FUNCTIONS)
    assert set(groups) - {REST} == set(FUNCTIONS)
    assert sum(groups.values()) == pytest.approx(sum(counts.values()))
    assert groups.get(REST, 0.0) < 0.02 * sum(counts.values())


def test_without_valgrind_instructions_are_not_counted_and_the_remedy_is_told(monkeypatch):
    problem = charge_problem(DEFAULT_PRESET, 1.0)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(InputError, match="valgrind: not found; install it"):
        instructions_of_period(problem)


def test_the_timed_parts_of_a_campaign_do_its_work_and_add_up():
    """The rows are those of a worker; by a clock that counts its readings each span takes one."""
    rows, readings = [], itertools.count()
    parts = campaign_parts(DEFAULT_PRESET, 2, lambda: next(readings), lambda *two: rows.append(two))
    assert len(rows) == 2
    for expected, found in rows:
        assert str(found) == str(expected)
    assert parts.periods > 10_000
    spans = {name: part_ms * 1e6 for name, part_ms in parts.parts_ms.items()}
    blocks = spans[NOISE_PART]
    assert blocks > 1.0
    assert spans[CELL_PART] == pytest.approx(3.0)
    assert spans[WATCH_PART] == pytest.approx(blocks - 1.0)
    assert spans[FIRMWARE_PART] == pytest.approx(0.0)
    # Set-up three times, the disturbance once more than the noise, three charges a block.
    assert sum(spans.values()) == pytest.approx(3.0 + (blocks + 1.0) + blocks + 3.0 * blocks)


def test_the_command_prints_parts_of_what_it_was_asked_for(bms):
    code, out, _ = bms(
        "bench", "--quick", "--json", "--section", "simulation", "--section", "campaign",
        "--bus", "virtual:bench-parts", "--campaign-runs", 1, "--jobs", 1,
    )  # fmt: skip
    assert code == 0
    result = json.loads(out)
    found = {one["figure"]: one for one in result["breakdowns"]}
    aimed = {aim["name"]: aim for aim in result["aims"]}
    assert set(found) == set(aimed)
    simulation = found["simulation on virtual:bench-parts, one process"]
    measured = aimed[simulation["figure"]]["measured"]
    assert sum(simulation["parts"].values()) == pytest.approx(0.1e6 / measured)
    assert {"cell model", "firmware", "recording", "bus (python-can)"} <= set(simulation["parts"])
