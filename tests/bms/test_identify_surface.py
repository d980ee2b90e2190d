"""`bms identify` without a measured core: what a cycler writes, what comes out, what is refused.

The recordings of a simulated cell are an independent oracle: the intervals must hold its truth.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bms.cell import ohmic_resistance_ohm
from bms.data.cycler import ColumnMap, CyclerFormat, read_cycler, write_own_columns
from bms.errors import InputError
from bms.identification.cell_identification import IdentifiedCell, identify_cell
from bms.identification.cell_preset import cell_preset
from bms.identification.geometry import shape
from bms.identification.preset_check import check_preset
from bms.identification.preset_toml import preset_toml
from bms.identification.rated import parse_rated, rated_limits
from bms.presets import Preset, load_preset
from bms.validation import parse, read_toml
from tests.bms.cycler_files import TRUTH, campaign

FORM = CyclerFormat(
    (ColumnMap.parse("time=0,current=1,voltage=2,surface=3,ambient=4"),), "degC", True
)
RATED = parse_rated(["max_charge_A=5", "max_voltage_V=4.2", "charge_temperature_degC=0..45"])
MEASURED = Path(__file__).parents[3] / "shared/data"
LINES = "0,-1,3.9,25,24\n1,-1,3.89,25.1,24\n2,0,3.95,25.2,24\n3,-1,3.88,25.2,24\n"


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return campaign(tmp_path_factory.mktemp("cycler"))


@pytest.fixture(scope="module")
def cell(files: dict[str, Path]) -> IdentifiedCell:
    used = [read_cycler(path, FORM) for name, path in files.items() if name != "unused"]
    return identify_cell(used, shape("21700"))


@pytest.fixture(scope="module")
def found(cell: IdentifiedCell) -> Preset:
    return cell_preset(cell, rated_limits(RATED, cell.recordings), "mine", {}).preset


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("core_resistance", "K_per_W"),
        ("core_heat_capacity", "J_per_K"),
        ("surface_resistance", "K_per_W"),
        ("surface_heat_capacity", "J_per_K"),
        ("capacity", "Ah"),
    ],
)
def test_intervals_hold_the_true_cell(found: Preset, name: str, unit: str) -> None:
    interval = found.cell.interval
    assert interval is not None
    low, high = getattr(interval, name)
    value, truth = getattr(found.cell, f"{name}_{unit}"), getattr(TRUTH, f"{name}_{unit}")
    assert low * value <= truth <= high * value


@pytest.mark.slow
@pytest.mark.parametrize("temperature_K", [290.0, 298.0, 310.0])
@pytest.mark.parametrize("soc", [0.2, 0.5, 0.85])
def test_interval_of_the_resistance_holds_the_true_one(
    found: Preset, temperature_K: float, soc: float
) -> None:
    interval = found.cell.interval
    assert interval is not None
    own = ohmic_resistance_ohm(found.cell, temperature_K, soc)
    truth = ohmic_resistance_ohm(TRUTH, temperature_K, soc)
    assert interval.resistance[0] * own <= truth <= interval.resistance[1] * own


@pytest.mark.slow
def test_open_circuit_voltage_is_the_true_one_within_its_error(
    cell: IdentifiedCell, found: Preset
) -> None:
    interval = found.cell.interval
    assert interval is not None
    share = cell.alignment.capacity_Ah / found.cell.capacity_Ah
    soc = np.linspace(0.1, 0.98, 45)
    missing_V = found.cell.ocv(soc * share) - TRUTH.ocv(soc)
    assert np.max(np.abs(missing_V)) <= interval.ocv_error_V


@pytest.mark.slow
def test_an_unused_recording_lies_within_the_intervals(
    found: Preset, files: dict[str, Path]
) -> None:
    check = check_preset(found, read_cycler(files["unused"], FORM))
    assert check.voltage_covered >= 0.95
    assert check.surface_covered is not None and check.surface_covered >= 0.95
    assert check.voltage_rmse_V <= 0.025


@pytest.mark.slow
def test_the_most_resistive_cell_of_the_family_can_be_proven_full_at_c_20(found: Preset) -> None:
    """With all that the firmware takes off a reading (docs/family.md, Full)."""
    cell, interval, limits = found.cell, found.cell.interval, found.limits
    greatest_ohm = interval.resistance[1] * float(
        ohmic_resistance_ohm(cell, 298.15, cell.resistance.soc[-1])
    ) + interval.polarisation[1] * sum(branch.resistance_ohm for branch in cell.branches)
    reading_V = limits.max_voltage_V - found.sensors.voltage_V.error_bound
    least_ocv_V = (
        reading_V
        - found.sensors.voltage_V.error_bound
        - interval.ocv_error_V
        - greatest_ohm * cell.capacity_Ah / 20.0
    )
    assert least_ocv_V >= float(cell.ocv(limits.completion_soc))
    assert limits.completion_soc > 0.9


@pytest.mark.slow
def test_another_cell_is_not_within_the_intervals(found: Preset, files: dict[str, Path]) -> None:
    other = read_cycler(files["unused"], FORM)
    rising = type(other)(**{**vars(other), "voltage_V": other.voltage_V + 0.3})
    assert check_preset(found, rising).voltage_covered < 0.5


@pytest.mark.slow
def test_every_number_of_the_preset_says_where_it_comes_from(
    cell: IdentifiedCell, tmp_path: Path
) -> None:
    made = cell_preset(cell, rated_limits(RATED, cell.recordings), "mine", {})
    text = preset_toml(made.preset, made.notes)
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    assert parse(Preset, read_toml(path), "mine") == made.preset
    section = "\n".join(text.split("\n[limits]")[1].split("\n[")[0].splitlines()[1:])
    assert all("#" in line for line in section.splitlines() if line)
    assert "max_voltage_V = 4.2  # data sheet (--rated)" in text


def test_what_the_recordings_do_not_show_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "one.csv"
    path.write_text(LINES)
    with pytest.raises(InputError, match="give --rated max_charge_A"):
        rated_limits({}, [read_cycler(path, FORM)])


def test_a_limit_that_is_given_needs_no_recording_that_shows_it(tmp_path: Path) -> None:
    path = tmp_path / "one.csv"
    path.write_text(LINES)
    assert rated_limits(RATED, [read_cycler(path, FORM)]).max_charge_A == 5.0


@pytest.mark.parametrize(
    "text",
    [
        LINES,
        "\ufeff" + LINES,
        LINES.replace(",", ";"),
        LINES.replace(",", "\t"),
        LINES.replace(",", ";").replace(".", ","),
        "Cycler 7\nmade by us\nt,I,U,T,Ta\n" + LINES,
        LINES.replace("\n", ",\n"),
    ],
    ids=["plain", "mark", "semicolon", "tab", "decimal comma", "preamble", "trailing"],
)
def test_a_table_is_read_however_it_is_written(tmp_path: Path, text: str) -> None:
    path = tmp_path / "recording.txt"
    path.write_text(text, encoding="utf-8")
    got = read_cycler(path, FORM)
    np.testing.assert_allclose(got.current_A, [1.0, 1.0, 0.0, 1.0])
    np.testing.assert_allclose(got.voltage_V, [3.9, 3.89, 3.95, 3.88])
    assert got.surface_K is not None
    np.testing.assert_allclose(got.surface_K, np.array([25, 25.1, 25.2, 25.2]) + 273.15)


@pytest.mark.parametrize(
    ("text", "form", "complaint"),
    [
        ("", FORM, "holds no measurement"),
        ("a,b\nc,d\n", FORM, "no line of numbers"),
        (LINES.replace("3.95", "n/a"), FORM, ":3: voltage: 'n/a' is not a finite number"),
        (LINES.replace("2,0", "0.5,0"), FORM, "time goes back"),
        (LINES + "4,-1\n", FORM, ":5: 2 values where the first row has 5"),
        (LINES, CyclerFormat(FORM.maps, "K", True), "give --temperature-unit degC"),
        (LINES, CyclerFormat(FORM.maps, "degC"), "give --charge-positive"),
        (LINES, CyclerFormat((ColumnMap.parse("current=1,voltage=2"),), "degC", True), "--sample-"),
        (LINES, CyclerFormat((), "degC", True), "give --columns"),
    ],
)
def test_a_bad_file_is_one_line_with_its_remedy(
    tmp_path: Path, text: str, form: CyclerFormat, complaint: str
) -> None:
    path = tmp_path / "recording.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_cycler(path, form)
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_without_time_counts_its_samples(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    path.write_text("row,current,voltage\n0,-1,3.9\n1,-1,3.89\n60,0,3.95\n61,-1,3.88\n")
    got = read_cycler(path, CyclerFormat((), "degC", True, 0.5))
    np.testing.assert_allclose(got.time_s, [0.0, 0.5, 30.0, 30.5])


def test_own_columns_read_back_as_the_same_recording(tmp_path: Path) -> None:
    path = tmp_path / "recording.csv"
    path.write_text(LINES)
    recording = read_cycler(path, FORM)
    write_own_columns(recording, tmp_path / "own.csv")
    again = read_cycler(tmp_path / "own.csv", CyclerFormat())
    for name in ("time_s", "current_A", "voltage_V", "surface_K", "ambient_K"):
        np.testing.assert_allclose(getattr(again, name), getattr(recording, name), atol=1e-6)


@pytest.mark.parametrize("text", ["18650", "21700", "prismatic:148x27x97", "pouch:200x150x8"])
def test_core_resistance_is_an_interval_around_its_middle(text: str) -> None:
    low, middle, high = shape(text).core_resistance_K_per_W
    assert 0.0 < low < middle < high


@pytest.mark.parametrize("text", ["186", "cone:3x4", "pouch:200x150", "cylinder:18x-65", "18650:1"])
def test_a_wrong_shape_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="--geometry"):
        shape(text)


@pytest.mark.parametrize(
    "text", ["max_charge_A", "max_charge_A=-4", "charge_temperature_degC=50..0", "colour=3"]
)
def test_a_wrong_limit_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="--rated"):
        parse_rated([text])


@pytest.mark.slow
def test_the_shipped_30q_is_what_the_command_makes_of_the_public_data() -> None:
    names = ("s001_c10", "s001_1c", "s001_4c", "dnn01_hppc_2c_20degc", "dnn01_hppc_2c_40degc")
    paths = [MEASURED / f"samsung_30q_{name}.csv" for name in names]
    unused = MEASURED / "samsung_30q_s001_2c.csv"
    if not all(path.exists() for path in (*paths, unused)):
        pytest.skip("not run: the public recordings of the 30Q are not here")
    columns = ColumnMap.parse("time=0,current=1,voltage=2,surface=4,ambient=6")
    form = CyclerFormat((columns,), "degC", True, 1.0)
    recordings = [read_cycler(path, form) for path in paths]
    rated = parse_rated(["max_charge_A=4", "max_voltage_V=4.2", "charge_temperature_degC=0..50"])
    cell = identify_cell(recordings, shape("18650"))
    made = cell_preset(cell, rated_limits(rated, recordings), "samsung_30q", {}).preset
    shipped = load_preset("samsung_30q")
    assert made.cell.capacity_Ah == pytest.approx(shipped.cell.capacity_Ah, rel=1e-3)
    assert made.cell.core_heat_capacity_J_per_K == pytest.approx(
        shipped.cell.core_heat_capacity_J_per_K, rel=1e-2
    )
    np.testing.assert_allclose(made.cell.ocv.voltage_V, shipped.cell.ocv.voltage_V, atol=2e-3)
    check = check_preset(shipped, read_cycler(unused, form))
    assert check.voltage_rmse_V <= 0.025
    assert check.surface_rmse_K is not None and check.surface_rmse_K <= 0.6
    assert min(check.voltage_covered, check.surface_covered or 0.0) >= 0.95
