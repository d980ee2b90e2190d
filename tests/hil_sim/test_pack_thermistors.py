"""Thermistors where a file says that they are: readings of those cells, bounds for the others."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from bms.errors import InputError
from bms.model.pair import load_pair
from hil_sim.bus.catalog import FirstFault
from hil_sim.pack.charge import charge_pack
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.faults import PackFault, complaint, run_fault
from hil_sim.pack.plant import PackPlant, PackWire
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.pack.summary import margins
from hil_sim.pack.thermistor_map import load_thermistor_map
from hil_sim.studies.pack.engine import NO_THERMISTOR

CELLS, AT = 7, (5, 0, 3)
"""Cells that have a thermistor, from 0 on, in the order in which they are sent."""
PRESET, MODEL = load_pair("paper_calibrated", None)


def settings_of(**changes):
    return PackChargeSettings(PRESET, MODEL, CELLS, **({"thermistor_at": AT} | changes))


def write(tmp_path, text):
    path = tmp_path / "pack.toml"
    path.write_text(text)
    return path


def test_the_file_counts_cells_from_1_in_the_order_of_the_readings(tmp_path):
    path = write(tmp_path, "[pack]\nthermistor_at = [6, 1, 4]\n")
    assert load_thermistor_map(path, CELLS) == AT


def test_each_reading_is_taken_for_that_of_the_cell_which_the_map_names():
    """The plant's surfaces differ; what the core believes of a cell is what that cell has."""
    settings = settings_of()
    ecu, plant = PackEcu(settings), PackPlant(settings)
    wire = PackWire(settings, plant)
    for cell in range(CELLS):
        state = plant.fields.plant.cell[cell].memory.state
        state.surface = state.core = 300.0 + cell
    for _ in range(10):
        plant.measure()
        wire.hear(ecu.exchange(wire.publish(charge=False)))
    pack = ecu.state.pack
    numbers = [pack.cell[cell].thermistor for cell in range(CELLS)]
    assert numbers == [1, NO_THERMISTOR, NO_THERMISTOR, 2, NO_THERMISTOR, 0, NO_THERMISTOR]
    for cell in AT:
        assert pack.cell[cell].surface_temperature_K == pytest.approx(300.0 + cell, abs=0.05)


def test_a_pack_by_its_map_becomes_full_and_no_cell_crosses_a_limit():
    result = charge_pack(settings_of())
    assert result.reason == "complete"
    assert (margins(result) >= 0.0).all()


@pytest.mark.parametrize(("reading", "cell"), [(0, 6), (1, 1), (2, 4)])
def test_a_thermistor_that_is_open_is_named_by_its_cell(reading, cell):
    def open_wire(plant, since, kept):
        plant.measured.surface_temperature_K[reading] = np.nan

    fault = PackFault("open", 0, (FirstFault.SURFACE_RANGE,), reading=open_wire)
    result = run_fault(settings_of(), fault, 10)
    assert complaint(result, fault) is None
    assert result.faulty_cell == cell


def test_a_map_of_all_cells_in_order_is_a_thermistor_each():
    short = replace(PRESET, initial=replace(PRESET.initial, soc=0.9))
    by_map = PackChargeSettings(short, MODEL, 3, thermistor_at=(0, 1, 2))
    each = PackChargeSettings(short, MODEL, 3)
    assert by_map.horizons() == each.horizons()
    assert charge_pack(by_map).commands_A == charge_pack(each).commands_A


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[pack]\nthermistor_at = [1, 8]\n", "cell 8: the pack has cells 1 to 7"),
        ("[pack]\nthermistor_at = [0]\n", "cell 0: the pack has cells 1 to 7"),
        ("[pack]\nthermistor_at = [2, 5, 2]\n", "cell 2 is named twice"),
        ("[pack]\nthermistor_at = []\n", "no cell; name one at least"),
        ("[pack]\nthermistor_at = [1.5]\n", "pack.thermistor_at.0"),
        ("[pack]\nthermistor_at = 3\n", "pack.thermistor_at"),
        ("[pack]\nthermistors = [3]\n", "thermistor"),
        ("thermistor_at = [3]\n", "pack"),
        ("[pack\n", "not valid TOML"),
    ],
)
def test_a_map_that_no_pack_has_is_refused_with_file_and_reason_in_one_line(tmp_path, text, said):
    with pytest.raises(InputError) as refused:
        load_thermistor_map(write(tmp_path, text), CELLS)
    assert "pack.toml" in str(refused.value) and said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_family_needs_them_all():
    family = load_pair("a123_26650_10C", None)
    PackChargeSettings(*family, 3, thermistor_at=(2, 0, 1))
    with pytest.raises(InputError, match="--thermistors: 2 of 3 cells"):
        PackChargeSettings(*family, 3, thermistor_at=(2, 0))


def test_the_commands_take_a_map(bms, tmp_path):
    path = write(tmp_path, "[pack]\nthermistor_at = [2]\n")
    log = tmp_path / "can.log"
    options = ("--cells", 3, "--thermistors", path)
    code, out, _ = bms("sil", *options, "--max-time-s", 5, "--log", log, "--json")
    assert code == 1 and json.loads(out)["thermistor_at"] == [2]
    code, out, _ = bms("replay", log, *options)
    assert code == 0, out
    code, out, _ = bms("replay", log, "--cells", 3, "--per-thermistor", 1)
    assert code != 0, "another map answers otherwise"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--cells", 3, "--per-thermistor", 2), "give one of both"),
        ((), "--thermistors: are for a pack; add --cells"),
        (("--cells", 1), "cell 2: the pack has cells 1 to 1"),
    ],
)
@pytest.mark.parametrize("command", ["sil", "plant", "ecu", "verify"])
def test_a_command_refuses_a_map_that_does_not_fit_in_one_line(
    bms, tmp_path, command, options, said
):
    path = write(tmp_path, "[pack]\nthermistor_at = [2]\n")
    bus = ("--bus", "udp_multicast:239.74.163.91") if command in ("plant", "ecu") else ()
    code, out, err = bms(command, *bus, "--thermistors", path, *options)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert said in err
