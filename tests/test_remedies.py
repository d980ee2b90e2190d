"""Commands that messages recommend exist, and take what the messages say."""

from __future__ import annotations

import ast
import functools
import importlib.util
import re
import shlex
from dataclasses import replace
from importlib.metadata import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from typer.core import TyperGroup

from bms import cli
from bms.errors import InputError, ModelMismatchError
from bms.firmware.calibration import calibration_block
from bms.model.make import model_for_preset
from bms.model.model_file import load_model, load_shipped_model, shipped_model_path, train_command
from bms.model.pair import load_pair
from bms.native_build import FIRMWARE
from bms.native_build import main as native_build
from bms.presets import load_preset, preset_path
from tests.conftest import Command

ROOT = Path(__file__).parents[1]
COMMAND = re.compile(r"'((?:bms|make|pip|python -m) [^']*?(?:'[^']*'[^']*?)??)'(?=[\s,;.)]|$)")
UNQUOTED_PIP = re.compile(r"pip install (?:'[^']+'|[\w=.]+(?: [\w=.]+)*)")
HOLE = "{}"
PLACES = {
    "CSV": "recording.csv", "PRESET.toml": "mine.toml", "PRESET": "lin2014", "MODEL": "model.json",
    "FILE": "file.log", "PORT": "5000", "BUS": "socketcan:vcan0", "FOLDER": "folder",
    "TREE": "tree", "OUT": "folder",
}  # fmt: skip
"""What stands in a message for something of the user's, and such a thing."""


def literals() -> list[tuple[str, str]]:
    """(place, text) of every string but docstrings; what f-strings fill in is a hole."""
    found = []
    for wing in ("bms", "codegen", "hil_sim"):
        for path in sorted((ROOT / wing).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            inner: set[int] = set()
            for node in ast.walk(tree):
                if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                    inner.add(id(node.value))
                if id(node) in inner:
                    continue
                where = f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}"
                if isinstance(node, ast.JoinedStr):
                    parts = [
                        str(part.value) if isinstance(part, ast.Constant) else HOLE
                        for part in node.values
                    ]
                    inner |= {id(part) for part in node.values}
                    found.append((where, "".join(parts)))
                elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                    found.append((where, node.value))
    return found


def commands() -> list[tuple[str, str]]:
    """(place, command) of every command that a message quotes."""
    return [
        (where, command)
        for where, text in literals()
        for pattern in (COMMAND, UNQUOTED_PIP)
        for command in pattern.findall(text)
        if not text.startswith("'bms train {}")  # made by train_command, tested below
    ]


def filled(command: str) -> list[str]:
    words = shlex.split(command.replace(HOLE, "1"))
    return [PLACES.get(word, word) for word in words]


def parse(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the real parser of the named program read the words; raises where it would refuse."""
    if words == ["bms", "--help"]:
        assert cli.application([]).commands
    elif words[0] == "bms":
        command = cli.application(words[1:]).commands[words[1]]
        context = command.make_context(words[1], words[2:])
        if isinstance(context.command, TyperGroup):  # a command with commands of its own
            name, subcommand, rest = context.command.resolve_command(context, words[2:])
            assert subcommand is not None
            subcommand.make_context(name, rest)
    elif words[0] == "make":
        rules = (ROOT / "Makefile").read_text() + (ROOT / "firmware_c/firmware.mk").read_text()
        assert re.search(rf"^{re.escape(words[1])}:", rules, re.MULTILINE), words
    elif words[:2] == ["pip", "install"]:
        ours = metadata("kan-rcbf-bms")
        for word in (word for word in words[2:] if not word.startswith("--")):
            requirement = Requirement(word)
            if requirement.name == ours["Name"] and "1" not in requirement.extras:
                assert requirement.extras <= set(ours.get_all("Provides-Extra") or ())
    elif words[:3] == ["python", "-m", "can.logconvert"]:
        assert importlib.util.find_spec(words[2])
        assert len(words) == 5
    else:
        assert words[:3] == ["python", "-m", "bms.native_build"]
        monkeypatch.setattr("sys.argv", ["native_build", *words[3:]])
        built = []
        monkeypatch.setattr(type(FIRMWARE), "builder", lambda self, *given: built.append(given))
        with pytest.raises(AttributeError):  # what the builder gives has no compile()
            native_build()
        assert len(built) == 1


def test_there_are_remedies_to_try() -> None:
    assert {command.split()[0] for _, command in commands()} == {"bms", "make", "pip", "python"}
    assert len(commands()) > 15


@pytest.mark.parametrize(
    ("where", "command"), commands(), ids=[f"{where} {command}" for where, command in commands()]
)
def test_recommended_command_is_taken(
    where: str, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    parse(filled(command), monkeypatch)


def quoted(message: str) -> list[list[str]]:
    """Commands of a message as words."""
    found = [shlex.split(command) for command in COMMAND.findall(message)]
    assert found, message
    return found


def changed_preset(folder: Path, capacity: str = "capacity_Ah = 4.6") -> Path:
    folder.mkdir(exist_ok=True)
    text = preset_path("lin2014").read_text(encoding="utf-8")
    assert "capacity_Ah = 2.3\n" in text
    path = folder / "mine.toml"
    path.write_text(text.replace("capacity_Ah = 2.3\n", f"{capacity}\n"), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "command",
    [
        ["sil"], ["verify"], ["export", "--out", "out"], ["fault-matrix"], ["ecu", "--bus", "udp"],
        ["campaign", "--runs", "1"], ["evaluate", "--model", "{model}"],
        ["bound", "--model", "{model}"],
    ],
    ids=lambda words: words[0],
)  # fmt: skip
def test_preset_of_a_file_is_told_the_command_that_trains_for_that_file(
    bms: Command,
    tmp_path: Path,
    command: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    path = changed_preset(tmp_path / "my cells")
    words = [word.format(model=shipped_model_path("lin2014")) for word in command]

    code, out, err = bms(*words, "--preset", path)

    assert (code, out) == (2, "")
    ((program, train, *rest),) = quoted(err)
    assert (program, train) == ("bms", "train")
    parse([program, train, *rest], monkeypatch)
    assert rest[:2] == ["--preset", str(path)]
    assert load_preset(rest[1]).cell.capacity_Ah == 4.6


@pytest.mark.slow
def test_remedy_for_a_preset_of_a_file_leads_to_a_model_of_that_preset(
    bms: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The command itself is run, with fewer steps and profiles than a good model needs."""
    monkeypatch.chdir(tmp_path)
    path = changed_preset(tmp_path)
    few = functools.partial(model_for_preset, counts={"training": 10, "validation": 5, "test": 60})
    monkeypatch.setattr("bms.commands.train.model_for_preset", few)
    with pytest.raises(ModelMismatchError) as refused:
        load_pair(path, None)
    ((_, *words),) = quoted(str(refused.value))

    assert bms(*words, "--epochs", "1", "--refinement-steps", "2")[0] == 0

    assert load_pair(path, words[-1])[1].training_hash == load_preset(path).training_hash


def test_preset_without_a_model_is_told_the_same(tmp_path: Path) -> None:
    path = changed_preset(tmp_path)
    path.write_text(path.read_text().replace('name = "lin2014"', 'name = "mine"'))

    with pytest.raises(InputError, match="no model ships") as refused:
        load_pair(path, None)

    assert quoted(str(refused.value)) == [shlex.split(train_command("mine", path).strip("'"))]


@pytest.mark.parametrize("given", [None, "mine.toml", "my cells/mine.toml"])
@pytest.mark.parametrize("name", [None, "lin2014", "mine"])
def test_command_to_train_is_taken_whatever_the_preset(
    name: str | None, given: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    (words,) = quoted(f"x {train_command(name, given)}".replace("''", "'"))
    parse([PLACES.get(word, word) for word in words], monkeypatch)


def test_edited_model_is_told_the_command_for_its_preset(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    text = shipped_model_path("lin2014").read_text(encoding="utf-8")
    path.write_text(text.replace('"seed": 0', '"seed": 1'), encoding="utf-8")

    with pytest.raises(InputError) as refused:
        load_model(path)

    (words,) = quoted(str(refused.value))
    assert words[:4] == ["bms", "train", "--preset", "lin2014"]


@pytest.mark.parametrize(
    ("line", "wrong", "named"),
    [
        ("alpha3_per_s2 = 0.00512", "alpha3_per_s2 = 1e-60", "rcbf.alpha3_per_s2 1e-60"),
        ("  0.0, 0.01,", "  0.0, 1e-60,", "ocv"),
        (
            "current_growth_A_per_s = 5.0",
            "current_growth_A_per_s = 1e-45",
            "current_growth_A 1e-46",
        ),
    ],
)
def test_constant_that_the_firmware_does_not_accept_is_named_with_its_value(
    tmp_path: Path, line: str, wrong: str, named: str
) -> None:
    text = preset_path("lin2014").read_text(encoding="utf-8")
    assert line in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(line, wrong), encoding="utf-8")
    preset = load_preset(path)
    model = replace(load_shipped_model("lin2014"), training_hash=preset.training_hash)

    with pytest.raises(InputError) as refused:
        calibration_block(preset, model, compiled_in=False)

    assert f"does not accept {named}; check" in str(refused.value)
