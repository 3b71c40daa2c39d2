"""Messages of the command line: notes and warnings, details with -v, progress of long steps.

They go to stderr; only the line of a result goes to stdout. rich respects NO_COLOR.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

from ..pictures.tables import Table
from ..reports import Report
from .interrupt import check

BAR_SECONDS = 1.0  # delay of the bar: a step of two seconds shows it for one second
LINE_SECONDS = 30.0  # between lines if stderr is no terminal: 120 lines per hour


class Messages:
    """Prints by verbosity: `verbose` adds details, `quiet` leaves only errors."""

    def __init__(self, verbose: bool = False, quiet: bool = False) -> None:
        self.verbose, self.quiet = verbose, quiet

    def note(self, text: str) -> None:
        """Print a remark, unless quiet."""
        if not self.quiet:
            print(f"note: {text}", file=sys.stderr, flush=True)

    def warning(self, text: str) -> None:
        """Print a warning, unless quiet."""
        if not self.quiet:
            print(f"warning: {text}", file=sys.stderr, flush=True)

    def error(self, text: str) -> None:
        """Print an error, even if quiet."""
        print(f"wgpu-gi: {text}", file=sys.stderr, flush=True)

    def detail(self, text: str) -> None:
        """Print a detail, with -v only."""
        if self.verbose:
            print(text, file=sys.stderr, flush=True)

    def result(self, text: str) -> None:
        """Print the line of a result to stdout, unless quiet."""
        if not self.quiet:
            print(text)

    @contextmanager
    def timed(self, what: str) -> Iterator[None]:
        """Show that a step of unknown length is running; with -v print its time."""
        start = time.perf_counter()
        with self.progress(what, known=False):
            yield
        self.detail(f"{what}: {time.perf_counter() - start:.2f} s")

    @contextmanager
    def board(self) -> Iterator[Callable[[float, str, Table], None]]:
        """Yield a function that shows the fraction done, a line and a table: on a terminal, else a line at intervals.

        The function raises KeyboardInterrupt if Ctrl-C came where it could not be raised.
        """
        if sys.stderr.isatty() and not self.quiet:
            with _live_board() as show:

                def report(fraction: float, line: str, table: Table) -> None:
                    check()
                    show(fraction, line, table)

                yield report
            return
        last = time.monotonic()

        def line_at_intervals(_fraction: float, line: str, _table: Table) -> None:
            nonlocal last
            check()
            if not self.quiet and time.monotonic() - last > LINE_SECONDS:
                last = time.monotonic()
                print(line, file=sys.stderr, flush=True)

        yield line_at_intervals

    @contextmanager
    def progress(self, what: str, known: bool = True) -> Iterator[Report]:
        """Yield a function that takes the fraction done and shows it: a bar on a terminal, else a line at intervals.

        If `known` is False, the bar shows only the elapsed time. The function raises KeyboardInterrupt if Ctrl-C came
        where it could not be raised.
        """
        bar = nullcontext(_nothing if self.quiet else _lines(what))
        with _bar(what, known) if sys.stderr.isatty() and not self.quiet else bar as show:

            def report(fraction: float, now: str | None = None) -> None:
                check()
                show(fraction, now)

            yield report


def _nothing(fraction: float, what: str | None = None) -> None:
    """Show nothing."""


@contextmanager
def _bar(what: str, known: bool) -> Iterator[Report]:
    """Yield a function that updates a bar with the time left. The bar appears after BAR_SECONDS."""
    # Before the first fraction, a renderer uploads the scene, builds its hierarchy and compiles shaders.
    state: dict[str, Any] = {"what": "preparing" if known else what}
    lock = threading.Lock()

    # A timer shows the bar, so quick commands show none and do not import rich.
    def appear() -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

        columns: list[Any] = [TextColumn("{task.description}"), BarColumn()]
        columns += [TaskProgressColumn(), TextColumn("{task.fields[left]}")] if known else [TimeElapsedColumn()]
        bar = Progress(*columns, console=Console(stderr=True), transient=True)
        with lock:
            if "ended" not in state:
                task = bar.add_task(state["what"], total=None, left="")
                bar.start()
                state["bar"] = bar, task

    start = time.monotonic()

    def report(fraction: float, now: str | None = None) -> None:
        state["what"] = now or what
        if "bar" in state:
            bar, task = state["bar"]
            left = _time_left(time.monotonic() - start, fraction)
            bar.update(task, description=state["what"], completed=fraction, total=1.0, left=left)

    # Run the caller's work, then remove the bar; the lock keeps a late timer from showing it.
    timer = threading.Timer(BAR_SECONDS, appear)
    timer.daemon = True
    timer.start()
    try:
        yield report
    finally:
        timer.cancel()
        with lock:
            state["ended"] = True
        if "bar" in state:
            state["bar"][0].stop()


@contextmanager
def _live_board() -> Iterator[Callable[[float, str, Table], None]]:
    """Yield a function that shows a line, a bar and a table, which are removed at the end."""
    from rich.console import Console, Group
    from rich.live import Live
    from rich.progress_bar import ProgressBar
    from rich.table import Table as Grid
    from rich.text import Text

    console = Console(stderr=True, highlight=False)
    with Live(console=console, transient=True, auto_refresh=False) as live:

        def show(fraction: float, line: str, table: Table) -> None:
            grid = Grid(*table.head, box=None, pad_edge=False)
            for row in table.rows[: max(console.height - 5, 1)]:
                grid.add_row(*map(str, row))
            parts: list[Any] = [Text(line), ProgressBar(total=1.0, completed=fraction), *([grid] if table.rows else [])]
            live.update(Group(*parts), refresh=True)

        yield show


def _lines(what: str) -> Report:
    """Return a report that prints a line every LINE_SECONDS."""
    start = last = time.monotonic()

    def report(fraction: float, now: str | None = None) -> None:
        nonlocal last
        moment = time.monotonic()
        if moment - last > LINE_SECONDS:
            last = moment
            line = f"{now or what}: {fraction:.0%} {_time_left(moment - start, fraction)}"
            print(line.rstrip(), file=sys.stderr, flush=True)

    return report


def _time_left(seconds: float, fraction: float) -> str:
    """Return the time left at the current rate, as text; empty while `fraction` is 0."""
    if fraction <= 0.0:
        return ""
    left = round(seconds * (1.0 - min(fraction, 1.0)) / fraction)
    hours, minutes = divmod(left // 60, 60)
    return f"{hours} h {minutes:02} min left" if hours else f"{left // 60}:{left % 60:02} left"
