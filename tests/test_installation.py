"""A source distribution of the project, and a wheel of that in an environment of its own.

All folders have blanks in their names. The environment holds the wheel and what it declares to
need, which is linked from the environment of the tests instead of being fetched again.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from collections.abc import Iterator
from importlib.metadata import Distribution, distribution, distributions, entry_points
from importlib.util import find_spec
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from bms.presets import DEFAULT_PRESET, load_preset
from hil_sim.dashboard.build import STATIC
from hil_sim.fmu.plant import PLANT_FILES, plant_unit
from tests.firmware.ports import image, needs_compiler
from tests.hil_sim.dashboard_page import needs_page

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
IS_CHECKOUT = (ROOT / ".git").exists()
WINGS = ("bms", "codegen", "hil_sim", "firmware_c")
COMMANDS = sorted({entry.name for entry in entry_points(group="bms.commands")})
METADATA = re.compile(r"PKG-INFO|setup\.cfg|[^/]+\.egg-info/.+")
"""What a source distribution has besides the sources."""
TESTS = ("tests/bms/test_cell.py", "tests/firmware/test_soc.py", "tests/codegen/test_generated.py")

ALL_HELP = f"""
import sys
from bms.cli import main
for name in {COMMANDS}:
    sys.argv = ["bms", name, "--help"]
    try:
        main()
    except SystemExit as stop:
        print("code", name, stop.code)
"""
PLACES = f"""
import importlib, json
from bms.native_build import FIRMWARE
from bms.studies.rivals.native_build import RIVALS
from hil_sim.native.native_build import NATIVE
from hil_sim.studies.campaign.native_build import RUNNER
extensions = [(e, importlib.import_module(e.module)) for e in (FIRMWARE, RIVALS, NATIVE, RUNNER)]
wings = [importlib.import_module(name) for name in {WINGS}]
print(json.dumps({{
    "places": [list(wing.__path__)[0] for wing in wings] + [m.__file__ for _, m in extensions],
    "stale": [e.module for e, m in extensions if e.is_stale(m)],
}}))
"""


def run(*command: object, folder: Path, check: bool = True) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder; nothing of the environment of the tests leads it to this code."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    words = [str(word) for word in command]
    done = subprocess.run(
        words, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 or not check, f"{words}\n{done.stdout}\n{done.stderr}"
    return done


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("a path with blanks")


@pytest.fixture(scope="module")
def source_archive(folder: Path) -> Path:
    """The source distribution."""
    metadata = folder / "metadata"
    metadata.mkdir()
    egg_info = ("egg_info", "--egg-base", metadata)
    run(sys.executable, "setup.py", "-q", *egg_info, "sdist", "-d", folder, folder=ROOT)
    (archive,) = folder.glob("*.tar.gz")
    return archive


@pytest.fixture(scope="module")
def sources(source_archive: Path, folder: Path) -> Path:
    """The source distribution, unpacked."""
    with tarfile.open(source_archive) as archive:
        if hasattr(tarfile, "data_filter"):
            archive.extractall(folder, filter="data")
        else:  # before Python 3.11.4
            archive.extractall(folder)
    return folder / source_archive.name.removesuffix(".tar.gz")


@pytest.fixture(scope="module")
def wheel(sources: Path, folder: Path) -> Path:
    """Wheel built from the unpacked source distribution."""
    build = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-build-isolation")
    run(*build, "--no-deps", "--no-index", "--wheel-dir", folder, ".", folder=sources)
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def python(wheel: Path, folder: Path) -> Path:
    """Interpreter of an environment with the wheel and what it declares to need."""
    home = folder / "environment"
    venv.EnvBuilder(symlinks=True).create(home)
    python = home / "bin" / "python"
    pip = (sys.executable, "-m", "pip", "--quiet", "--python", python)
    run(*pip, "install", "--no-deps", "--no-index", "--no-compile", wheel, folder=folder)
    (packages,) = home.glob("lib/python*/site-packages")
    (installed,) = distributions(path=[str(packages)])
    for needed in declared(installed):
        link(needed, packages)
    return python


def declared(of: Distribution, seen: frozenset[str] = frozenset()) -> Iterator[Distribution]:
    """What a distribution needs at run time, and what that needs."""
    for text in of.requires or ():
        requirement = Requirement(text)
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
            continue
        if requirement.name not in seen:
            found = distribution(requirement.name)
            yield found
            yield from declared(found, seen | {requirement.name})


def link(needed: Distribution, packages: Path) -> None:
    """Make a distribution part of another environment."""
    for name in {file.parts[0] for file in needed.files or ()} - {"..", "__pycache__"}:
        if not (packages / name).exists():
            (packages / name).symlink_to(str(needed.locate_file(name)))


@pytest.fixture(scope="module")
def anywhere(folder: Path) -> Path:
    """A folder that has nothing to do with the project."""
    place = folder / "any where"
    place.mkdir()
    return place


@pytest.mark.skipif(not IS_CHECKOUT, reason="not run: git does not track these sources")
def test_the_source_distribution_holds_what_git_tracks(source_archive: Path) -> None:
    tracked = set(run("git", "ls-files", folder=ROOT).stdout.splitlines())
    with tarfile.open(source_archive) as archive:
        files = {m.name.partition("/")[2] for m in archive.getmembers() if m.isfile()}
    assert {name for name in files if not METADATA.fullmatch(name)} == tracked


def test_the_source_distribution_builds_and_tests_itself(sources: Path) -> None:
    run(sys.executable, "setup.py", "-q", "build_ext", "--inplace", folder=sources)
    tests = (sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *TESTS)
    out = run(*tests, folder=sources).stdout
    assert re.search(r"^firmware: (.+)$", out, re.M)[1].startswith(str(sources))
    assert " failed" not in out
    assert int(re.search(r"(\d+) passed", out)[1]) > 30
    assert re.search(r"SKIPPED .* not run: .*shared/data/.* is absent", out)


def test_one_wheel_serves_every_python_from_3_10_on(wheel: Path) -> None:
    assert re.fullmatch(r"kan_rcbf_bms-[\d.]+-cp310-abi3-\w+\.whl", wheel.name)


@needs_page
def test_the_page_in_it_has_the_bytes_of_that_of_the_repository(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        place = f"{STATIC.relative_to(ROOT).as_posix()}/"
        names = [name for name in archive.namelist() if name.startswith(place)]
        page = {name.removeprefix(place): archive.read(name) for name in names}
        assert not [name for name in archive.namelist() if "dashboard/web" in name]
    built = {p.relative_to(STATIC).as_posix(): p for p in STATIC.rglob("*") if p.is_file()}
    assert page == {name: path.read_bytes() for name, path in built.items()}
    assert {"index.html", "page.wasm"} <= set(page)


@pytest.mark.skipif(
    find_spec("abi3audit") is None and "CI" not in os.environ,
    reason="not run: abi3audit is not installed",
)
def test_its_extensions_use_the_stable_abi_only(wheel: Path, tmp_path: Path) -> None:
    audit = (sys.executable, "-m", "abi3audit", "--strict")
    run(*audit, wheel, folder=tmp_path)
    other = find_spec("numpy._core._multiarray_umath")
    assert other is not None and other.origin is not None
    shutil.copy(other.origin, tmp_path / "other.abi3.so")
    assert run(*audit, "other.abi3.so", folder=tmp_path, check=False).returncode == 1


def test_all_that_runs_comes_from_the_wheel(python: Path, anywhere: Path) -> None:
    found = json.loads(run(python, "-c", PLACES, folder=anywhere).stdout)
    packages = str(python.parents[1])
    assert [place for place in found["places"] if not place.startswith(packages)] == []
    assert found["stale"] == []


def test_every_command_says_what_it_is_from_any_folder(python: Path, anywhere: Path) -> None:
    listed = run(python.with_name("bms"), "--help", folder=anywhere).stdout
    assert [name for name in COMMANDS if f" {name} " not in listed] == []
    out = run(python, "-c", ALL_HELP, folder=anywhere).stdout
    assert re.findall(r"^code (\S+) 0$", out, re.M) == COMMANDS


def test_a_charge_is_that_of_the_repository(python: Path, anywhere: Path, bms) -> None:
    charge = ("sil", "--max-time-s", "5", "--out")
    run(python.with_name("bms"), *charge, "installed", folder=anywhere, check=False)
    code, _, _ = bms(*charge, anywhere / "repository")
    assert code == 1
    log = (anywhere / "installed" / "can.log").read_bytes()
    assert log == (anywhere / "repository" / "can.log").read_bytes()
    assert len(log.splitlines()) > 500


def test_a_row_of_the_fault_matrix_is_played(python: Path, anywhere: Path) -> None:
    row = ("fault-matrix", "--rows", "lost twice", "--jobs", "1", "--json")
    played = json.loads(run(python.with_name("bms"), *row, folder=anywhere).stdout)
    assert played["rows"] > 0
    assert played["red"] == 0


def test_the_sources_that_it_exports_are_those_of_the_repository(
    python: Path, anywhere: Path
) -> None:
    folders = ("--out", "export", "--sources", "core")
    run(python.with_name("bms"), "export", *folders, folder=anywhere)
    kept, written = (
        {path.name: path.read_bytes() for path in place.glob("*.[ch]")}
        for place in (ROOT / "firmware_c" / "generated", anywhere / "export")
    )
    assert written == kept
    assert (anywhere / "core" / "CMakeLists.txt").is_file()


def test_the_units_that_it_exports_are_those_of_the_repository(
    python: Path, anywhere: Path
) -> None:
    run(python.with_name("bms"), "export", "--fmu", "plant", "--out", "units", folder=anywhere)
    preset = load_preset(DEFAULT_PRESET)
    for version, name in PLANT_FILES.items():
        assert (anywhere / "units" / name).read_bytes() == plant_unit(preset, version)


@needs_compiler
def test_an_image_that_is_missing_is_made_by_the_command_that_is_named(
    python: Path, anywhere: Path
) -> None:
    """The image has the bytes of that of the repository, where nothing else has a blank."""
    missing = run(
        python.with_name("bms"), "sil", "--target", "qemu:mps2-an386", folder=anywhere, check=False
    )
    assert missing.returncode == 2
    assert missing.stderr.count("\n") == 1
    command = re.search(r"no such file; run '(.+)' first$", missing.stderr)[1]
    run("sh", "-c", command, folder=anywhere)
    made = anywhere / "build" / "firmware" / "mps2_an386" / "firmware.bin"
    assert made.read_bytes() == image("mps2_an386")


def test_the_guest_that_has_a_can_bus_comes_along(python: Path, anywhere: Path) -> None:
    plant = (python.with_name("bms"), "plant", "--bus", "socketcan:none0")
    refused = run(*plant, folder=anywhere, check=False)
    assert refused.returncode == 2
    script = re.search(r"run the command inside '(.+?)', which provides", refused.stderr)[1]
    assert Path(script).is_relative_to(python.parents[1])
    usage = run(script, folder=anywhere, check=False)
    assert (usage.returncode, usage.stderr.startswith("vcan_guest: usage:")) == (64, True)


def test_the_generated_files_of_the_repository_are_not_written_from_elsewhere(
    python: Path, anywhere: Path
) -> None:
    refused = run(python, "-m", "codegen", folder=anywhere, check=False)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "is no checkout; 'bms export' writes" in refused.stderr
