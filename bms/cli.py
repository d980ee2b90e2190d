"""The `bms` command: loads its subcommands from the entry points of the group `bms.commands`."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint, entry_points

import click
import typer
from typer.core import TyperGroup
from typer.main import get_command

from bms.errors import BmsError

EXIT_DONE, EXIT_CHECK_FAILED, EXIT_WRONG_USE = 0, 1, 2


def _commands() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group="bms.commands")}


class _LazyGroup(TyperGroup):
    """Imports a subcommand only when it is asked for, so that `bms ecu` starts fast."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(_commands())

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        entry = _commands().get(cmd_name)
        if entry is None:
            return None
        app = typer.Typer(add_completion=False)
        app.command(name=cmd_name)(entry.load())
        return get_command(app)


app = typer.Typer(
    cls=_LazyGroup,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Battery-management firmware simulator: train, export, build and charge over a CAN bus.",
)


@app.callback()
def _root() -> None:
    """Battery-management firmware simulator. Currents are negative while charging; SI units."""


def main() -> None:
    """Run the command line; errors that a user can act on become one line and exit code 2."""
    command = get_command(app)
    try:
        code = command.main(standalone_mode=False)
    except BmsError as error:
        print(f"bms: {error}", file=sys.stderr)
        sys.exit(EXIT_WRONG_USE)
    except click.ClickException as error:
        print(f"bms: {error.format_message()}; see 'bms --help'", file=sys.stderr)
        sys.exit(EXIT_WRONG_USE)
    except (KeyboardInterrupt, click.Abort):
        print("bms: interrupted", file=sys.stderr)
        sys.exit(130)
    sys.exit(code if isinstance(code, int) else EXIT_DONE)
