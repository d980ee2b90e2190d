"""Two builds of the firmware on a folder of logs: what would a change have done differently."""

import gzip
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bms.errors import InputError
from hil_sim.replay.builds import compare_builds, logs_in
from tests.hil_sim.golden.record import FOLDER

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def deaf_to_cold_sensor(tmp_path_factory):
    """A build that ignores one fault: a surface that reads colder than the heat allows."""
    folder = tmp_path_factory.mktemp("mutant")
    shutil.copytree(ROOT / "firmware_c", folder / "tree" / "firmware_c")
    source = folder / "tree" / "firmware_c" / "src" / "bms_symptoms.c"
    text = source.read_text()
    assert text.count("limits->surface_deficit_K)") == 1
    source.write_text(text.replace("limits->surface_deficit_K)", "9999.0f)"))
    build = [sys.executable, "-m", "bms.native_build", "--tree", folder / "tree"]
    subprocess.run([*build, "--out", folder / "out"], check=True, cwd=ROOT, capture_output=True)
    return folder / "out"


def test_a_mutant_differs_on_exactly_the_golden_log_of_its_fault(bms, deaf_to_cold_sensor):
    code, out, _ = bms("replay", "--against", ROOT, deaf_to_cold_sensor, FOLDER, "--json")
    content = json.loads(out)
    assert code == 1
    assert content["equal"] is False
    assert [log["log"] for log in content["logs"]] == [path.name for path in logs_in(FOLDER)]
    (changed,) = [log for log in content["logs"] if log["differing_periods"]]
    assert changed["log"] == "sensor_fault.log.gz"
    assert changed["gone_faults"] == ["SurfaceDeficit"]
    # What was measured stays as recorded, without the current that this build still commands.
    assert changed["new_faults"] == ["CurrentDeviation"]
    assert changed["first_difference_period"] == 120
    assert changed["first_difference_s"] == 12.0
    assert changed["largest_current_difference_A"] > 1.0
    assert changed["charge_difference_Ah"] > 0.0


def test_the_table_has_a_line_for_each_log(bms, deaf_to_cold_sensor, tmp_path):
    for name in ("sensor_fault", "charge_start"):
        shutil.copy(FOLDER / f"{name}.log.gz", tmp_path)
    code, out, _ = bms("replay", "--against", deaf_to_cold_sensor, ROOT, tmp_path)
    assert code == 1
    assert "sensor_fault.log.gz: B alone raises SurfaceDeficit" in out
    assert "the builds differ on 1 of 2 logs" in out


def test_a_build_equals_itself(bms, tmp_path):
    shutil.copy(FOLDER / "request_off_on.log.gz", tmp_path)
    code, out, _ = bms("replay", "--against", ROOT, ROOT, tmp_path)
    assert code == 0
    assert "the builds differ on 0 of 1 logs" in out


def test_one_channel_of_a_log_is_compared(bms, tmp_path):
    lines = gzip.decompress((FOLDER / "infeasible.log.gz").read_bytes()).decode().splitlines()
    both = [line.replace("vcan0", channel) for line in lines for channel in ("can0", "can1")]
    (tmp_path / "both.log").write_text("\n".join([*both, ""]))
    code, out, _ = bms("replay", "--against", ROOT, ROOT, tmp_path, "--channel", "can1")
    assert code == 0
    assert f"both.log: not read: {len(lines)} frames of other channels" in out


def test_a_build_that_breaks_down_is_named(tmp_path):
    shutil.copytree(ROOT / "bms" / "firmware", tmp_path / "bms" / "firmware")
    (extension,) = (tmp_path / "bms" / "firmware").glob("_firmware*.so")
    extension.write_bytes(b"no extension")
    with pytest.raises(InputError, match=f"{tmp_path}: cannot be loaded"):
        compare_builds((ROOT, tmp_path), [FOLDER / "complete.log.gz"], None, None)


def test_an_unusable_log_is_named(tmp_path):
    (tmp_path / "foreign.log").write_text("(0.000000) vcan0 123#01 R\n")
    with pytest.raises(InputError, match=r"foreign\.log: foreign"):
        compare_builds((ROOT, ROOT), logs_in(tmp_path), None, None)
