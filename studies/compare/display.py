"""What a comparison shows while it runs: a bar with the time left, and below it the table so far.

On a terminal both are drawn in place and go when they are done. Anywhere else plain lines say the same: one
as a phase begins, and at most ten as it goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import monotonic

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TaskID, TextColumn
from rich.text import Text

_LINES = 10  # at most, as a phase goes on, where the output is no terminal
_PAUSE = 2.0  # [s] at least, between two of them
_REDRAW = 1.0  # [s] at least, between two tables on a terminal


@dataclass
class Phase:
    """One part of the work: how much is done, and how long the rest takes.

    Attributes:
        title: what is done.
        total: steps in all.
        expected: [s] how long it takes, before a step tells better; None where nobody knows.
        steady: steps take about equal times, so that those which are done tell how long the others take.
        completed: steps that are done.
        kept: steps that were done before this run.
        started: when, by `time.monotonic`.
    """

    title: str
    total: int
    expected: float | None = None
    steady: bool = True
    completed: int = 0
    kept: int = 0
    started: float = field(default_factory=monotonic)

    @property
    def seconds_left(self) -> float | None:
        """[s] how long the rest takes; None where nobody knows."""
        passed, own = monotonic() - self.started, self.completed - self.kept
        if not self.steady or own == 0:
            return None if self.expected is None else max(self.expected - passed, 0.0)
        rest = self.total - self.completed
        measured = passed / own * rest
        if self.expected is None:
            return measured
        done = own / (own + rest)  # the first steps wait for processes to start: they count little yet
        return done * measured + (1.0 - done) * self.expected * (1.0 - done)

    def describe_time(self) -> str:
        """Time passed and time left, in words."""
        passed, left = f"{monotonic() - self.started:.0f} s", self.seconds_left
        if left is None or self.completed == self.total:
            return passed
        return f"{passed}, about {left:.0f} s left" if left >= 1.0 else f"{passed}, almost done"


class Display:
    """One phase on the console; only `show_phase` makes one."""

    def __init__(self, console: Console, phase: Phase) -> None:
        """Show nothing yet."""
        self.console, self.phase = console, phase
        self._below: RenderableType = ""
        self._told, self._told_at = 0, phase.started
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            _TimeColumn(phase),
            console=console,
        )
        self._task: TaskID = self._progress.add_task(
            phase.title, total=phase.total, completed=phase.completed
        )

    def __rich__(self) -> RenderableType:
        """The bar, and what stands below it."""
        return Group(self._progress, self._below)

    def begin(self) -> None:
        """Say on plain output what begins."""
        if not self.console.is_terminal:
            about = "" if self.phase.expected is None else f" (about {self.phase.expected:.0f} s)"
            self.print(f"{self.phase.title}{about}")

    def advance(
        self,
        steps: int,
        below: Callable[[], RenderableType] | None = None,
        note: Callable[[], str] | None = None,
    ) -> None:
        """Show that steps are done.

        Args:
            steps: how many more.
            below: makes what a terminal shows below the bar; called once a second at most.
            note: makes what plain output says behind the numbers; called for a line that is printed.
        """
        phase, now = self.phase, monotonic()
        phase.completed += steps
        last = phase.completed == phase.total
        if self.console.is_terminal:
            self._progress.update(self._task, completed=phase.completed)
            if below is not None and (last or now - self._told_at >= _REDRAW):
                self._below, self._told_at = below(), now
            return
        due = phase.completed * _LINES // max(phase.total, 1)
        if due > self._told and (last or now - self._told_at >= _PAUSE):
            self._told, self._told_at = due, now
            said = f"{phase.title}: {phase.completed}/{phase.total}, {phase.describe_time()}"
            self.print(said if note is None else f"{said}; {note()}")

    def print(self, line: str) -> None:
        """Print a line that stays."""
        self.console.print(line, markup=False, highlight=False, soft_wrap=True)


class _TimeColumn(ProgressColumn):
    def __init__(self, phase: Phase) -> None:
        super().__init__()
        self._phase = phase

    def render(self, task: Task) -> Text:
        del task
        return Text(self._phase.describe_time())


@contextmanager
def show_phase(console: Console, phase: Phase) -> Iterator[Display]:
    """Show a phase while it runs."""
    display = Display(console, phase)
    display.begin()
    if not console.is_terminal:
        yield display
        return
    with Live(display, console=console, transient=True, refresh_per_second=4):
        yield display
