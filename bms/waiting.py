"""Commands that take long say on standard error what they do and how far they are.

On a terminal that is a bar, which is gone when the work is done. Elsewhere it is a line after 10 s
and one each time that the wait has doubled: few, however long it lasts. Standard output is left to
the result.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

FIRST_LINE_S = 10.0
_REFRESHES_PER_S = 1.0
"""Few, because the bar shares the processor with what is waited for."""

_Show = Callable[[str, float], None]


class Wait:
    """What a command does now, and how far it is in the unit of its total."""

    def __init__(self, show: _Show, doing: str, completed: float) -> None:
        self._show, self._doing, self._completed = show, doing, completed
        self._has_begun = False

    def begin(self, what: str) -> None:
        """The next of the things is done from now on; the one before it is complete."""
        self.reach(self._completed + self._has_begun, what)
        self._has_begun = True

    def advance(self, amount: float = 1.0) -> None:
        """As much more is done."""
        self.reach(self._completed + amount)

    def reach(self, completed: float, doing: str | None = None) -> None:
        """As much is done in all, and this goes on."""
        self._completed = completed
        self._doing = self._doing if doing is None else doing
        self._show(self._doing, self._completed)


@contextmanager
def waiting(
    doing: str,
    total: float = 1.0,
    unit: str = "",
    completed: float = 0.0,
    clock_s: Callable[[], float] = time.monotonic,
) -> Iterator[Wait]:
    """Tell of the work in the `with` block: `total` things of a unit, or per cent of it without."""

    def amount(completed: float) -> str:
        if unit:
            return f"{completed:.0f} of {total:.0f} {unit}"
        return f"{100.0 * completed / total:.0f} %"

    console = Console(stderr=True)
    if sys.stderr.isatty() and not console.is_dumb_terminal:
        with _bar(console, total, amount) as show:
            show(doing, completed)
            yield Wait(show, doing, completed)
    else:
        yield Wait(_lines(amount, clock_s), doing, completed)


@contextmanager
def _bar(console: Console, total: float, amount: Callable[[float], str]) -> Iterator[_Show]:
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[amount]}", markup=False),
        TimeElapsedColumn(),
    )
    with Progress(
        *columns,
        console=console,
        transient=True,
        refresh_per_second=_REFRESHES_PER_S,
        redirect_stdout=False,
    ) as bar:
        task = bar.add_task("", total=total, amount="")

        def show(doing: str, completed: float) -> None:
            bar.update(task, description=doing, completed=completed, amount=amount(completed))

        yield show


def _lines(amount: Callable[[float], str], clock_s: Callable[[], float]) -> _Show:
    start_s = clock_s()
    next_s = FIRST_LINE_S

    def show(doing: str, completed: float) -> None:
        nonlocal next_s
        waited_s = clock_s() - start_s
        if waited_s >= next_s:
            print(f"bms: {doing}: {amount(completed)}, {waited_s:.0f} s", file=sys.stderr)
            while next_s <= waited_s:
                next_s *= 2.0

    return show
