"""Standard output for results, and standard error for messages and progress."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from syncplan.errors import InputError

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from syncplan.estimation.divided_runs import RunOfTrials
    from syncplan.estimation.filter_options import FilterOptions
    from syncplan.guidance.flown_team import FlownTeam
    from syncplan.results.stories import Report
    from syncplan.studies.study import Execution, Study

PIPED_WIDTH = 160
"""Width of tables in a file or for another program, unless COLUMNS is set."""


class Format(StrEnum):
    """Format of standard output."""

    auto = "auto"
    table = "table"
    json = "json"


def deliver(
    values: dict[str, Any],
    output: Path | None,
    format_: Format,
    report: "Report | None",
) -> Format:
    """Write the JSON to the file or standard output, or show the table; return which was shown.

    With a file, only a table goes to standard output.
    """
    from syncplan.runtime.files import as_text, write_text

    if str(output) == "-":
        output, format_ = None, Format.json
    shown = format_
    if shown is Format.auto:
        shown = Format.table if sys.stdout.isatty() else Format.json
    if output is not None:
        write_text(output, as_text(values))
        say(f"wrote {output}")
    with reader_may_leave():
        if output is None and shown is Format.json:
            sys.stdout.write(as_text(values))
        if shown is Format.table and report is not None:
            from rich.console import Console

            from syncplan.cli.fitted_tables import show_story

            piped = not (sys.stdout.isatty() or os.environ.get("COLUMNS"))
            show_story(
                report.story(), Console(highlight=False, width=PIPED_WIDTH if piped else None)
            )
    return shown


@contextmanager
def reader_may_leave() -> Iterator[None]:
    """Write to standard output; discard the rest if its reader leaves, as head does."""
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        _silence(sys.stdout)
    except SystemExit as leaving:
        # click and rich turn a broken pipe into SystemExit
        if not isinstance(leaving.__context__, BrokenPipeError):
            raise
        _silence(sys.stdout)


def _silence(stream: TextIO) -> None:
    """Discard further output to a stream, so that no flush fails."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def deliver_report(report: "Report", output: Path | None, format_: Format) -> None:
    """Deliver a report; after JSON, write its notes to standard error."""
    if deliver(report.as_json(), output, format_, report) is Format.json:
        say_notes(getattr(report, "notes", []))


def check_output(output: Path | None, *sources: str) -> None:
    """Raise InputError if the output can't be written, or is one of the sources.

    Called before the run, which may take hours.
    """
    from syncplan.runtime.files import check_writable

    if output is None or str(output) == "-":
        return
    for source in sources:
        with suppress(OSError):
            if source != "-" and output.samefile(source):
                problem = "is the file that is read; give another one to write"
                raise InputError(problem, source=str(output))
    check_writable(output)


def open_closed_streams() -> None:
    """Open the null device for standard streams that the process was started without."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def carried_out(study: "Study", subject: Any, options: Any, threads: int | None) -> Any:
    """Return the result of a study; compiles its kernels first, and shows its progress."""
    from syncplan.estimation.divided_runs import results_of
    from syncplan.studies.study import TrialStudy

    if isinstance(study, TrialStudy):
        runs = [*study.runs(subject, options)]
        _compile_runs(runs)
        with progress_bar(study.unit, sum(run.trials for run in runs)) as progress:
            results = results_of(runs, threads=threads, progress=progress)
        return study.joined(subject, options, results)
    with progress_bar(study.unit, study.work(subject, options)) as progress:
        return study.run(subject, options, execution(threads, progress))


def execution(threads: int | None, progress: Callable[..., None] | None) -> "Execution":
    """Return how a study is carried out by so many threads, with the progress on a bar."""
    from syncplan.studies.study import ALONE

    heard = (lambda done, **_known: progress(done)) if progress else ALONE.progress
    return replace(ALONE, workers=threads, progress=heard)


def _compile_runs(runs: "Iterable[RunOfTrials]") -> None:
    """Compile the kernels of validations and flights; those of other runs compile when used."""
    from syncplan.planning.plan_flights import FlightRun
    from syncplan.planning.validation import TrialRun

    for run in runs:
        if isinstance(run, TrialRun):
            compile_filter(run.options, [run.true_team.count])
        elif isinstance(run, FlightRun):
            compile_flight(run.team)


def compile_filter(options: "FilterOptions", counts: Iterable[int]) -> None:
    """Compile the filter's kernels for teams of these sizes, unless they are compiled."""
    from syncplan.estimation.filter_options import lane_filter_of

    filter_ = lane_filter_of(options.filter_model)
    missing = [count for count in sorted(set(counts)) if not filter_.is_compiled(count)]
    if missing:
        with _compiling("the filter's kernels", "10 to 20 s"):
            for count in missing:
                filter_.compile(count)


def compile_flight(team: "FlownTeam") -> None:
    """Compile the kernels of a team's flights, unless they are compiled."""
    from syncplan.guidance.flights import compile_flights, flight_is_compiled

    if not flight_is_compiled(team):
        with _compiling("the kernels of flight", "15 to 40 s"):
            compile_flights(team)


@contextmanager
def _compiling(kernels: str, duration: str) -> Iterator[None]:
    """Announce a compilation; at a terminal, show its elapsed time."""
    say(f"compiling {kernels}, once; on two cores this takes {duration} ...")
    with _lines_with_time() as shown:
        if shown is not None:
            shown.add_task("compiling", total=None)
        yield


def say_notes(notes: list[str]) -> None:
    """Write notes to standard error."""
    for note in notes:
        say(note)


@contextmanager
def progress_bar(unit: str, total: int) -> Iterator[Callable[..., None] | None]:
    """A progress bar on standard error, at a terminal only.

    It is called with what is done, and with another total or text where these change.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    with bar:
        task = bar.add_task(unit, total=total)
        yield lambda done, total=total, text=unit: bar.update(
            task, completed=done, total=total, description=text
        )


@contextmanager
def _lines_with_time() -> Iterator["Progress | None"]:
    """Lines on standard error, each with its elapsed time, at a terminal only."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        yield shown


@contextmanager
def search_progress() -> Iterator[Callable[[int, int, float], None] | None]:
    """A line for each start of a search, with its objective at every iteration, at a terminal."""
    lines: dict[int, TaskID] = {}
    with _lines_with_time() as shown:

        def report(start: int, iteration: int, objective: float) -> None:
            assert shown is not None
            text = f"start {start + 1}, iteration {iteration}: objective {objective:.6g}"
            if start not in lines:
                lines[start] = shown.add_task(text, total=None)
            shown.update(lines[start], description=text)

        yield None if shown is None else report


def say_begun(subject: str, run: str) -> None:
    """Say at a terminal that a run of a file is being prepared; called before slow imports."""
    if sys.stderr.isatty():
        say(f"reading {'standard input' if subject == '-' else subject}, preparing {run} ...")


def say(message: str) -> None:
    """Write one line to standard error."""
    try:
        sys.stderr.write(f"syncplan: {message}\n")
        sys.stderr.flush()
    except BrokenPipeError:
        _silence(sys.stderr)
