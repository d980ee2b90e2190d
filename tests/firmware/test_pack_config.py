"""Which packs there can be: each condition on a configuration, broken alone."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import NO_THERMISTOR
from tests.hil_sim.pack_rig import PackRig, core_of, ordinary

ONE_CELL, FAMILY = "paper_calibrated", "a123_26650_10C"
BARE = ordinary(ONE_CELL).bare
NONE = NO_THERMISTOR
LARGEST = 3.4028234663852886e38
TOO_LARGE = math.inf


class Pack:
    """A pack as it is right after its start, and the readings of its first periods."""

    def __init__(self, map_: Any, thermistors: int, preset: str = ONE_CELL, **changes: Any) -> None:
        self.core = core_of(preset)
        self.state = ffi.new("pack_t *")
        cells = len(map_) if map_ is not None else 1
        self._map = ffi.new("uint8_t[]", map_ or [0])
        config = {
            "calibration": self.core.calibration,
            "cells": cells,
            "thermistors": thermistors,
            "thermistor_of": self._map,
            "bare": BARE,
        } | changes
        lib.pack_init(self.state, ffi.new("pack_config_t *", config))

    @property
    def is_taken(self) -> bool:
        """Whether the configuration is one of a pack."""
        return bool(self.state.calibration != ffi.NULL)


def assert_refused(pack: Any) -> None:
    """No cell, no current, and after a period the fault of a calibration, whatever is asked for."""
    assert (pack.calibration, pack.cells, pack.thermistors) == (ffi.NULL, 0, 0)
    for charge in (False, True, True):
        readings = ffi.new("pack_readings_t *", {"charge": charge, "reference_current_A": -5.0})
        lib.pack_step(pack, readings)
        assert (pack.state, pack.command_A) == (lib.BMS_FAULT, 0.0)
        assert pack.monitor.latched == 1 << lib.FAULT_CALIBRATION
        own = lib.pack_cell_decision(pack, readings, 0, -5.0)
        assert (own.active, own.feasible, own.current_A) == (lib.RCBF_INVALID, False, 0.0)


def test_without_a_configuration_there_is_no_pack() -> None:
    pack = ffi.new("pack_t *")
    lib.pack_init(pack, ffi.NULL)
    assert_refused(pack)


@pytest.mark.parametrize("missing", ["calibration", "thermistor_of"])
def test_without_a_part_of_its_configuration_there_is_no_pack(missing: str) -> None:
    assert Pack([0, 1], 2).is_taken
    assert_refused(Pack([0, 1], 2, **{missing: ffi.NULL}).state)


def test_a_calibration_that_is_damaged_is_refused() -> None:
    damaged = ffi.new("bms_calibration_t *", core_of(ONE_CELL).calibration[0])
    assert Pack([0, 1], 2, calibration=damaged).is_taken
    damaged.rcbf.capacity_As = math.nan
    assert_refused(Pack([0, 1], 2, calibration=damaged).state)


@pytest.mark.parametrize("preset", [ONE_CELL, FAMILY])
def test_a_pack_has_from_one_cell_to_as_many_as_fit(preset: str) -> None:
    most = lib.BMS_MAX_CELLS if preset == ONE_CELL else lib.BMS_MAX_FAMILY_CELLS
    for cells in (1, 2, most):
        assert Pack(list(range(cells)), cells, preset).is_taken
    assert_refused(Pack([], 0, preset).state)
    too_many = [*range(most), NONE]
    assert_refused(Pack(too_many, most, preset).state)


@pytest.mark.parametrize(
    ("map_", "thermistors", "is_taken"),
    [
        ([0, 1, 2], 3, True),
        ([2, 0, 1], 3, True),
        ([0, NONE, 1], 2, True),
        ([NONE, NONE, 0], 1, True),
        ([0, 1, 1], 3, False),  # two cells by one thermistor
        ([1, NONE, 1], 2, False),
        ([0, 1, 3], 3, False),  # one past the last
        ([0, 1, 2], 2, False),
        ([0, 1, 2], 4, False),  # more than cells
        ([0, NONE, NONE], 2, False),  # fewer than cells, but one is at none
        ([1, NONE, NONE], 2, False),
        ([NONE, NONE, NONE], 0, False),  # nothing is measured
        ([NONE, NONE, NONE], 1, False),
        ([0, NONE, NONE], 0, False),
    ],
)
def test_each_thermistor_is_at_one_cell_and_one_is_there_at_least(
    map_: list[int], thermistors: int, is_taken: bool
) -> None:
    pack = Pack(map_, thermistors)
    assert pack.is_taken is is_taken
    if is_taken:
        assert [pack.state.cell[i].thermistor for i in range(3)] == map_
    else:
        assert_refused(pack.state)


def test_a_family_has_a_thermistor_at_each_cell() -> None:
    assert Pack([0, 1], 2, FAMILY).is_taken
    assert_refused(Pack([0, NONE], 1, FAMILY).state)


@pytest.mark.parametrize("name", BARE)
def test_a_cell_without_a_thermistor_needs_each_number_of_its_bound(name: str) -> None:
    """From 0 up, and a factor on a resistance above 0; a pack without such a cell needs none."""
    good = [LARGEST, 1.0] if name == "resistance_factor" else [LARGEST, 1.0, 0.0]
    bad = [math.nan, math.inf, -math.inf, -1e-30, *({0.0} - set(good))]
    for value in good:
        assert Pack([0, NONE], 1, bare=BARE | {name: value}).is_taken, value
    for value in bad:
        assert_refused(Pack([0, NONE], 1, bare=BARE | {name: value}).state)
        assert Pack([0, 1], 2, bare=BARE | {name: value}).is_taken, value


@pytest.mark.parametrize("preset", [ONE_CELL, FAMILY])
def test_a_cell_beyond_the_last_one_has_no_decision(preset: str) -> None:
    rig = PackRig(core_of(preset), 2)
    rig.step(60)
    rig.step(charge=True)
    for cell, has_one in ((0, True), (1, True), (2, False), (2**32 - 1, False)):
        own = rig.own_decision(cell, -1.0)
        assert (own.active != lib.RCBF_INVALID) is has_one
        if not has_one:
            assert (own.feasible, own.current_A) == (False, 0.0)
            assert math.isnan(own.lower_A) and math.isnan(own.upper_A)
