"""The `bms` command: its subcommands are the entry points of the group `bms.commands`."""

from __future__ import annotations

import ast
import logging
import os
import sys
from collections.abc import Callable
from importlib.abc import InspectLoader
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup
from typer.exceptions import Abort, TyperException
from typer.main import get_command, get_group

from bms.errors import BmsError
from bms.imports import left_out
from bms.interruption import EXIT_INTERRUPTED, INTERRUPTED, prompt_interrupts
from bms.plain_text import write_plainly

EXIT_DONE, EXIT_CHECK_FAILED, EXIT_WRONG_USE = 0, 1, 2


_SUBCOMMANDS = "subcommands"
Function = TypeVar("Function", bound=Callable[..., Any])


def with_subcommands(*subcommands: Callable[..., Any]) -> Callable[[Function], Function]:
    """Decorator of a command that has commands of its own, by the names of their functions."""

    def mark(function: Function) -> Function:
        setattr(function, _SUBCOMMANDS, subcommands)
        return function

    return mark


class _LazyCommand(TyperCommand):
    """A command that is imported when it is called.

    The list of commands and the start of `bms ecu` stay short that way.
    """

    def __init__(self, entry: EntryPoint) -> None:
        super().__init__(entry.name, help=docstring(entry))
        self._entry = entry

    def make_context(self, *arguments: Any, **extra: Any) -> Any:
        """Context of the imported command, which then takes the place of this one."""
        # python-can's own writer of MF4 would load it, with all of pandas.
        with left_out("asammdf"):
            function = self._entry.load()
        subcommands = getattr(function, _SUBCOMMANDS, ())
        app = _typer(no_args_is_help=True) if subcommands else _typer()
        if not subcommands:
            app.command(name=self.name)(function)
            return get_command(app).make_context(*arguments, **extra)
        app.callback()(function)
        for subcommand in subcommands:
            app.command()(subcommand)
        return get_group(app).make_context(*arguments, **extra)


def docstring(entry: EntryPoint) -> str:
    """Docstring of a command's function, from its source where there is one."""
    spec = find_spec(entry.module)
    if spec is not None and isinstance(spec.loader, InspectLoader):
        for node in ast.parse(spec.loader.get_source(entry.module) or "").body:
            if isinstance(node, ast.FunctionDef) and node.name == entry.attr:
                return ast.get_docstring(node) or ""
    return entry.load().__doc__ or ""


def _typer(**settings: Any) -> typer.Typer:
    return typer.Typer(add_completion=False, pretty_exceptions_enable=False, **settings)


def _root() -> None:
    """Battery-management firmware simulator. SI units; currents are negative while charging.

    Example: bms sil --preset paper_calibrated --out out/run
    """


def application(arguments: list[str]) -> TyperGroup:
    """Application with the command that is asked for, or with all when none is named."""
    commands = {entry.name: entry for entry in entry_points(group="bms.commands")}
    wanted = arguments[0] if arguments else ""
    app = _typer(no_args_is_help=True)
    app.callback()(_root)
    group = get_group(app)
    for name in [wanted] if wanted in commands else sorted(commands):
        group.add_command(_LazyCommand(commands[name]))
    return group


def main() -> None:
    """Run the command line; what a user can act on becomes one line on stderr and exit code 2."""
    # The matrices here are small: threads of the linear algebra would only wait for each other.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    # It tells of its own caches, for example where the home folder cannot be written.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    write_plainly()
    try:
        with prompt_interrupts():
            code = application(sys.argv[1:])(standalone_mode=False)
            if code == EXIT_INTERRUPTED:  # what becomes of KeyboardInterrupt in typer
                raise KeyboardInterrupt
    except BmsError as error:
        print(f"bms: {error}", file=sys.stderr)
        sys.exit(EXIT_WRONG_USE)
    except TyperException as error:
        reason = error.format_message().rstrip(".") or "no command given"
        print(f"bms: {reason}; see 'bms --help'", file=sys.stderr)
        sys.exit(EXIT_WRONG_USE)
    except OSError as error:  # a path of the user's, for whose look-up no command has words
        where = "" if error.filename is None else f"{error.filename}: "
        reason = error.strerror or str(error)
        print(f"bms: {where}{reason}; choose a file or folder that you may use", file=sys.stderr)
        sys.exit(EXIT_WRONG_USE)
    except (KeyboardInterrupt, Abort):
        print(INTERRUPTED, file=sys.stderr)
        sys.exit(EXIT_INTERRUPTED)
    sys.exit(code if isinstance(code, int) else EXIT_DONE)
