"""Versions, changelog, architecture and commit hooks are in step with what they speak of."""

import re
import sys

import yaml

import bms
from bms.calibration.calibration_block import LAYOUT
from bms.firmware._firmware import lib
from bms.model.model_file import FORMAT_VERSION
from tests.docs.pages import ROOT
from tools.architecture_picture import CORE, PICTURE, picture

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
    "importlinter"
]["contracts"]


def page(name):
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_page_of_versions_has_the_numbers_of_the_sources():
    table = dict(
        re.findall(r"^\| ([a-z ]+) \| ([\d.]+) \|", page("docs/versions.md"), re.MULTILINE)
    )
    assert table == {
        "package": bms.__version__,
        "firmware version": str(lib.BMS_FIRMWARE_VERSION),
        "calibration layout": str(lib.BMS_CALIBRATION_LAYOUT),
        "image header layout": str(lib.IMAGE_HEADER_LAYOUT),
        "model file format": str(FORMAT_VERSION),
    }
    assert LAYOUT == lib.BMS_CALIBRATION_LAYOUT


def test_the_changelog_names_this_version_and_what_an_image_of_the_newest_sources_says():
    sections = re.split(r"^## ", page("CHANGELOG.md"), flags=re.MULTILINE)[1:]
    headings = [section.partition("\n")[0] for section in sections]
    assert headings[0] == "Unreleased"
    assert re.fullmatch(rf"{re.escape(bms.__version__)} - \d{{4}}-\d\d-\d\d", headings[1])
    firmware, layout = lib.BMS_FIRMWARE_VERSION, lib.BMS_CALIBRATION_LAYOUT
    assert (
        sections[0]
        .split("\n\n")[1]
        .startswith(f"Firmware version {firmware}, calibration layout {layout}")
    )


def test_the_picture_is_what_the_contracts_of_import_linter_say():
    assert PICTURE.read_text(encoding="utf-8") == picture(CONTRACTS), (
        "run 'python -m tools.architecture_picture'"
    )


def test_the_c_core_in_the_picture_is_that_of_the_folder():
    names = {word for group in CORE for row in group for word in row.split("   ")}
    # A source without a header of its own, such as choices.c, has only checks for the compiler.
    headers = {path.stem for path in (ROOT / "firmware_c" / "include").glob("*.h")}
    modules = {path.stem for path in (ROOT / "firmware_c" / "src").glob("*.c")} & headers
    assert len(modules) > 10
    assert modules <= names
    folders = {name.rstrip("/") for name in names if name.endswith("/")}
    assert all((ROOT / "firmware_c" / folder).is_dir() for folder in folders)


def test_every_package_has_a_line_on_the_page_of_the_architecture():
    told = set(re.findall(r"`([\w/]+)/`", page("docs/architecture.md").split("## The way of")[0]))
    packages = {
        path.parent.relative_to(ROOT).as_posix()
        for wing in ("bms", "codegen", "hil_sim")
        for path in (ROOT / wing).rglob("__init__.py")
    }
    assert packages - told == {"bms/studies", "hil_sim/studies"}
    folders = {
        f"firmware_c/{path.name}" for path in (ROOT / "firmware_c").iterdir() if path.is_dir()
    }
    assert folders - told == set()


def test_commit_hooks_call_the_tools_of_make_lint():
    (recipe,) = re.findall(r"^lint:.*\n((?:\t.*\n)+)", page("Makefile"), re.MULTILINE)
    recipe = recipe.replace("$(BIN)", ".venv/bin").replace('CC="$(CC)" ', "")
    lint = {line.strip().removesuffix(" .") for line in recipe.splitlines()}
    (repository,) = yaml.safe_load(page(".pre-commit-config.yaml"))["repos"]
    assert repository["repo"] == "local"
    assert {hook["language"] for hook in repository["hooks"]} == {"system"}
    hooks = {hook["entry"].replace(" --force-exclude", "") for hook in repository["hooks"]}
    assert hooks == lint
