"""The `bms` command: loads its subcommands from the entry points of the group `bms.commands`."""

from __future__ import annotations

import os
import sys
from importlib.metadata import entry_points

import typer
from typer.exceptions import Abort, TyperException

from bms.errors import BmsError

EXIT_DONE, EXIT_CHECK_FAILED, EXIT_WRONG_USE, EXIT_INTERRUPTED = 0, 1, 2, 130


def _root() -> None:
    """Battery-management firmware simulator. SI units; currents are negative while charging.

    Example: bms sil --preset paper_calibrated --out out/run
    """


def _application(arguments: list[str]) -> typer.Typer:
    """Application with the command that is asked for, or with all when none is named.

    Loading one only keeps the start of `bms ecu` short.
    """
    commands = {entry.name: entry for entry in entry_points(group="bms.commands")}
    wanted = arguments[0] if arguments else ""
    names = [wanted] if wanted in commands else sorted(commands)
    app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False)
    app.callback()(_root)
    for name in names:
        app.command(name=name)(commands[name].load())
    return app


def main() -> None:
    """Run the command line; what a user can act on becomes one line on stderr and exit code 2."""
    # The matrices here are small: threads of the linear algebra would only wait for each other.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    try:
        code = _application(sys.argv[1:])(standalone_mode=False)
    except BmsError as error:
        print(f"bms: {error}", file=sys.stderr)
        sys.exit(EXIT_WRONG_USE)
    except TyperException as error:
        reason = error.format_message().rstrip(".") or "no command given"
        print(f"bms: {reason}; see 'bms --help'", file=sys.stderr)
        sys.exit(EXIT_WRONG_USE)
    except (KeyboardInterrupt, Abort):
        print("bms: interrupted", file=sys.stderr)
        sys.exit(EXIT_INTERRUPTED)
    sys.exit(code if isinstance(code, int) else EXIT_DONE)
