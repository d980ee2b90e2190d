"""What README and pages name is there: files, links, make targets, commands with their options."""

import re
import sys
from functools import cache
from importlib import import_module
from importlib.util import find_spec

import pytest
import typer

from tests.docs.pages import PAGES, ROOT, commands, links, name, paths

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
COMMANDS = PROJECT["entry-points"]["bms.commands"]
PLACEHOLDER = "COMMAND"
each_page = pytest.mark.parametrize("page", PAGES, ids=name)


def make_targets():
    makefiles = ("Makefile", "firmware_c/firmware.mk")
    text = "\n".join((ROOT / path).read_text(encoding="utf-8") for path in makefiles)
    return set(re.findall(r"^([a-z][a-z-]*):", text, re.MULTILINE))


@cache
def options_of(command):
    """Options of a bms command, as its parser takes them."""
    module, name = COMMANDS[command].split(":")
    function = getattr(import_module(module), name)
    parameters = []
    for each in (function, *getattr(function, "subcommands", ())):
        app = typer.Typer(add_completion=False)
        app.command()(each)
        parameters += typer.main.get_command(app).params
    return {"--help"}.union(*({*p.opts, *p.secondary_opts} for p in parameters))


@each_page
def test_links_lead_to_files_of_the_repository(page):
    assert [target for target in links(page) if not (page.parent / target).exists()] == []


@each_page
def test_paths_in_the_text_exist(page):
    """But for the board that docs/ports.md adds; a test of its own follows it there."""
    missing = [path for path in paths(page) if not any(ROOT.glob(path.rstrip("/")))]
    assert [path for path in missing if "/mps2_an500/" not in path] == []


@each_page
def test_make_targets_exist(page):
    named = [words[0] for program, *words in commands(page) if program == "make" and words]
    assert set(named) - make_targets() - {"-f"} == set()


def bms_commands(page):
    """Command and further words of each use of bms."""
    uses = [words[1:] for words in commands(page) if words[0] == "bms" and len(words) > 1]
    return [words for words in uses if words[0] not in (PLACEHOLDER, "--help")]


@each_page
def test_bms_commands_exist(page):
    assert {words[0] for words in bms_commands(page)} - set(COMMANDS) == set()


@pytest.mark.slow
@each_page
def test_bms_commands_take_the_options_that_are_named(page):
    for command, *words in bms_commands(page):
        named = {word.partition("=")[0] for word in words if word.startswith("--")}
        assert named <= options_of(command), " ".join(["bms", command, *words])


@each_page
def test_python_modules_exist(page):
    for program, *words in commands(page):
        if program == "python" and words[:1] == ["-m"]:
            assert find_spec(words[1]) is not None, words[1]


def test_every_bms_command_stands_on_the_page_of_commands():
    told = {tuple(words[:2]) for words in commands(ROOT / "docs" / "commands.md")}
    assert {("bms", command) for command in COMMANDS} - told == set()


def test_the_readme_s_first_screen_has_picture_two_commands_and_a_link_for_each_reader():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    first = "\n".join(lines[: lines.index("## What comes out")])
    assert len(first.splitlines()) <= 24
    assert first.count("![") == 1
    assert re.findall(r"^(?:make|bms) \S+", first, re.MULTILINE) == ["make run", "make test"]
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    readers = re.findall(r"docs/index\.md#([a-z-]+)", first)
    assert len(readers) == 5
    assert set(readers) <= {
        heading.lower().replace(" ", "-")
        for heading in re.findall(r"^## (.+)$", index, re.MULTILINE)
    }


def test_each_reader_has_three_to_five_links():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    sections = index.split("\n## ")[1:5]
    assert [
        3 <= len(re.findall(r"^\d\. ", section, re.MULTILINE)) <= 5 for section in sections
    ] == [True] * 4
