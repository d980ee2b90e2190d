"""An option has one meaning: commands that share its name share its help text."""

from importlib.metadata import entry_points

import pytest
import typer

pytestmark = pytest.mark.slow  # loads every command


@pytest.fixture(scope="module")
def help_texts():
    """Option name -> command name -> help text, of every command of `bms`."""
    texts = {}
    for entry in entry_points(group="bms.commands"):
        app = typer.Typer()
        app.command(name=entry.name)(entry.load())
        for parameter in typer.main.get_command(app).params:
            for option in parameter.opts:
                texts.setdefault(option, {})[entry.name] = getattr(parameter, "help", None)
    return texts


def test_all_commands_are_looked_at(help_texts):
    assert {"train", "export", "sil", "reproduce"} <= set().union(*help_texts.values())


TAKES_MORE = {("--data", "identify")}
"""Option and command whose help says what every other's says, and then what else is taken."""


@pytest.mark.parametrize("option", ["--json", "--data", "--faults", "--rows", "--jobs"])
def test_help_is_the_same_in_every_command(help_texts, option):
    texts = help_texts[option]
    same = {text for name, text in texts.items() if (option, name) not in TAKES_MORE}
    assert len(texts) > 1
    assert len(same) == 1, texts
    (shared,) = same
    for text in set(texts.values()) - same:
        assert text.startswith(f"{shared} Or, ")


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("--preset", ": name of a shipped one, or path of a TOML file."),
        ("--model", "(JSON)."),
        ("--seed", "Seed of "),
    ],
)
def test_form_of_a_value_is_told_alike_in_every_command(help_texts, option, said):
    texts = help_texts[option]
    assert len(texts) > 5
    assert [name for name, text in texts.items() if said not in text] == []
