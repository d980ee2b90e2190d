"""`bms export --sources`: builds, computes what the firmware computes, replaces nothing else."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from bms.decision import ACTIVE_CONSTRAINTS
from bms.errors import InputError, ModelMismatchError
from bms.firmware import Firmware
from bms.model.model_file import load_shipped_model, shipped_model_path
from bms.native_build import ROOT
from bms.presets import load_preset, one_cell_preset_names
from codegen.core_sources import CHECKSUMS_FILE, core_sources, write_core
from tests.codegen.cmake import build, needs_cmake

Command = Callable[..., tuple[int, str, str]]

ANSWERS = Path(__file__).with_name("answers.c")
PROJECT = """
cmake_minimum_required(VERSION 3.16)
project(own LANGUAGES C)
add_compile_options(-Wall -Wextra {flags})
add_executable(application application.c)
add_executable(answers answers.c)
{readme}
target_link_libraries(answers PRIVATE bms::core)
"""


def exported(preset: str) -> dict[str, bytes]:
    return core_sources(load_preset(preset), load_shipped_model(preset))


def blocks(readme: str, language: str) -> str:
    return "\n".join(re.findall(rf"```{language}\n(.*?)```", readme, re.DOTALL))


def files_below(folder: Path) -> dict[str, bytes]:
    paths = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def rows_to_try(count: int) -> npt.NDArray[np.float32]:
    """States in and around the operating range, and numbers that are none or not physical.

    Some are full but for the last percent, and some have a surface at its limit beside hotter
    coolant: there the constraints decide that elsewhere leave more than the others.
    """
    random = np.random.default_rng(11)
    low = np.array([-25.0, -0.5, 275.0, 270.0, -0.1, 275.0, 275.0, 270.0, -0.5, -25.0])
    high = np.array([1.0, 1.5, 330.0, 328.0, 1.1, 330.0, 330.0, 328.0, 1.5, 0.5])
    rows = random.uniform(low, high, (count, len(low)))
    decision = slice(4, 10)
    nearly_full = [0.99, 295.0, 290.0, 290.0, 0.0, -23.0], [1.0, 305.0, 305.0, 300.0, 1.0, -20.0]
    hot_surface = [0.2, 290.0, 322.2, 334.0, 0.0, -23.0], [0.8, 322.0, 322.7, 340.0, 1.0, -10.0]
    for first, (least, most) in enumerate((nearly_full, hot_surface)):
        part = rows[first::10, decision]
        part[:] = random.uniform(least, most, part.shape)
    rows = rows.astype(np.float32)
    odd = np.array([np.nan, np.inf, -np.inf, 3e38, -3e38, 0.0, 1e-42], np.float32)
    places = random.random(rows.shape) < 0.02
    rows[places] = random.choice(odd, np.count_nonzero(places))
    return rows


def expected(firmware: Firmware, row: npt.NDArray[np.float32]) -> list[str]:
    current, cooling, surface, coolant, *state = map(float, row)
    estimate = firmware.estimate(
        current_A=current,
        cooling_power_W=cooling,
        surface_temperature_K=surface,
        coolant_temperature_K=coolant,
    )
    names = ("soc", "core_temperature_K", "surface_temperature_K", "coolant_temperature_K")
    decision = firmware.solve(
        **dict(zip((*names, "cooling_power_W", "reference_current_A"), state, strict=True))
    )
    return [
        estimate.core_temperature_K.hex(),
        str(int(estimate.in_domain)),
        decision.current_A.hex(),
        str(int(decision.feasible)),
        str(ACTIVE_CONSTRAINTS.index(decision.active_constraint)),
        decision.lower_A.hex(),
        decision.upper_A.hex(),
    ]


def same(printed: list[str], wanted: list[str]) -> bool:
    """Equal to the last bit; printf and Python write the same numbers in different ways."""
    pairs = list(zip(map(float.fromhex, printed), map(float.fromhex, wanted), strict=True))
    return all(a.hex() == b.hex() for a, b in pairs)


@needs_cmake
@pytest.mark.slow
@pytest.mark.parametrize(
    ("preset", "flags"),
    [("paper_calibrated", ""), ("lin2014", "-O3 -ffast-math")],
    ids=["paper_calibrated", "lin2014 in a project that wants fast mathematics"],
)
def test_the_exported_core_builds_and_computes_what_the_firmware_computes(
    bms: Command, tmp_path: Path, preset: str, flags: str
) -> None:
    assert {"paper_calibrated", "lin2014"} == {*one_cell_preset_names()}
    code, printed, error = bms("export", "--sources", tmp_path / "core", "--preset", preset)
    assert (code, error) == (0, "")
    assert printed.split() == [str(tmp_path / "core" / name) for name in exported(preset)]

    readme = (tmp_path / "core" / "README.md").read_text(encoding="utf-8")
    assert {load_preset(preset).hash, load_shipped_model(preset).hash} <= {*readme.split("`")}
    project = PROJECT.format(flags=flags, readme=blocks(readme, "cmake"))
    (tmp_path / "CMakeLists.txt").write_text(project)
    (tmp_path / "application.c").write_text(
        f"{blocks(readme, 'c')}\nint main(void) {{ return 0; }}"
    )
    shutil.copy(ANSWERS, tmp_path)
    folder = build(tmp_path, tmp_path / "build")

    rows = rows_to_try(1000)
    text = "\n".join(" ".join(float(value).hex() for value in row) for row in rows)
    answers = subprocess.run(
        [folder / "answers"], input=text, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    firmware = Firmware(preset=preset)
    wanted = [expected(firmware, row) for row in rows]
    wrong = [
        (row, line, answer)
        for row, line, answer in zip(rows, answers, wanted, strict=True)
        if not same(line.split(), answer)
    ]
    assert wrong == []
    assert {"0", "1"} == {answer[1] for answer in wanted}
    of_one_cell = set(ACTIVE_CONSTRAINTS) - {"map", "core_unknown"}
    assert {str(ACTIVE_CONSTRAINTS.index(name)) for name in of_one_cell} == {
        answer[4] for answer in wanted
    }


@needs_cmake
@pytest.mark.slow
def test_a_familys_export_says_how_to_decide_for_a_family_and_builds(tmp_path: Path) -> None:
    contents = exported("a123_26650_10C")
    write_core(tmp_path / "core", contents)
    readme = contents["README.md"].decode()
    code = blocks(readme, "c")
    assert "family_observe" in code
    assert "rcbf_solve" not in code
    (tmp_path / "CMakeLists.txt").write_text(
        PROJECT.format(flags="", readme=blocks(readme, "cmake"))
    )
    (tmp_path / "application.c").write_text(f"{code}\nint main(void) {{ return 0; }}")
    shutil.copy(ANSWERS, tmp_path)
    build(tmp_path, tmp_path / "build")


def test_an_export_holds_the_sources_as_they_are_and_what_is_generated_for_the_pair() -> None:
    contents = exported("paper_calibrated")
    assert [*contents] == sorted(contents)
    for path in (ROOT / "firmware_c").glob("*/*.[ch]"):
        if path.parent.name in ("include", "src", "generated"):
            name = path.relative_to(ROOT / "firmware_c").as_posix()
            assert contents.pop(name) == path.read_bytes()
    assert {*contents} == {"CMakeLists.txt", "LICENSE", "README.md", CHECKSUMS_FILE}
    assert contents["LICENSE"] == (ROOT / "LICENSE").read_bytes()


def test_the_same_pair_gives_the_same_bytes_anywhere() -> None:
    assert exported("lin2014") == exported("lin2014")
    text = b"".join(exported("lin2014").values()).decode()
    assert str(ROOT) not in text
    assert not re.search(r"\b20[2-9]\d-\d\d", text)


def test_the_readme_names_every_header_with_its_purpose() -> None:
    readme = exported("lin2014")["README.md"].decode()
    for path in (ROOT / "firmware_c" / "include").glob("*.h"):
        assert re.search(rf"\| `{path.name}` \| [A-Z][^|]{{20,}} \|", readme), path.name
    assert "| `history.h` | What the estimator remembers: low-pass filters of" in readme


def test_the_checksums_are_those_of_all_other_files(tmp_path: Path) -> None:
    write_core(tmp_path, exported("lin2014"))
    written = files_below(tmp_path)
    lines = written.pop(CHECKSUMS_FILE).decode().splitlines()
    assert lines == [f"{sha256(written[name]).hexdigest()}  {name}" for name in sorted(written)]


def test_another_export_replaces_the_first_and_leaves_other_files_alone(tmp_path: Path) -> None:
    write_core(tmp_path, exported("lin2014"))
    (tmp_path / "src" / "own.c").write_text("int own;")
    (tmp_path / "notes").mkdir()
    write_core(tmp_path, exported("paper_calibrated"))
    assert files_below(tmp_path) == {**exported("paper_calibrated"), "src/own.c": b"int own;"}
    assert (tmp_path / "notes").is_dir()


@pytest.mark.parametrize("name", ["README.md", "CMakeLists.txt", "src/kan.c"])
def test_a_file_of_the_users_own_is_never_replaced(tmp_path: Path, name: str) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("mine")
    with pytest.raises(InputError, match=rf"{name}: is not as 'bms export' has written it.*choose"):
        write_core(tmp_path, exported("lin2014"))
    assert files_below(tmp_path) == {name: b"mine"}


def test_a_file_that_was_changed_after_an_export_is_not_replaced(tmp_path: Path) -> None:
    write_core(tmp_path, exported("lin2014"))
    changed = tmp_path / "src" / "soc.c"
    changed.write_bytes(changed.read_bytes() + b"/* tuned */\n")
    before = files_below(tmp_path)
    with pytest.raises(InputError, match=r"src/soc\.c"):
        write_core(tmp_path, exported("paper_calibrated"))
    assert files_below(tmp_path) == before


def test_a_folder_that_cannot_be_completed_gets_nothing(tmp_path: Path) -> None:
    (tmp_path / "src").write_text("a file where a folder has to be")
    with pytest.raises(InputError, match="cannot be written"):
        write_core(tmp_path, exported("lin2014"))
    assert [path.name for path in tmp_path.rglob("*")] == ["src"]


def test_a_model_of_another_cell_is_refused() -> None:
    with pytest.raises(ModelMismatchError):
        core_sources(load_preset("lin2014"), load_shipped_model("paper_calibrated"))


def test_without_a_folder_the_command_says_which_options_there_are(bms: Command) -> None:
    assert bms("export") == (
        2,
        "",
        "bms: export: no folder is named; add --out DIR, --sources DIR or both\n",
    )


def test_both_folders_can_be_written_at_once_for_a_model_of_ones_own(
    bms: Command, tmp_path: Path
) -> None:
    model = shipped_model_path("lin2014", lagged=True)
    arguments = ("--preset", "lin2014", "--model", model)
    code, _, error = bms("export", *arguments, "--out", tmp_path / "a", "--sources", tmp_path / "b")
    assert (code, error) == (0, "")
    assert (tmp_path / "a" / "calibration.bin").is_file()
    constants = (tmp_path / "a" / "calibration_default.c").read_bytes()
    assert (tmp_path / "b" / "generated" / "calibration_default.c").read_bytes() == constants
    assert b".lags = 2u" in constants
