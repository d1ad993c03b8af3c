"""Errors that syncplan raises on purpose; a message names the object, its value and a remedy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

MOST_LINES = 10
"""Most faults that are listed, one a line."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of the input.

    Attributes
    ----------
    key : dotted path inside the document, or the name of an option
    problem : what is wrong, and what is allowed, in one line
    value : given value, as short JSON; empty if there is none
    """

    key: str
    problem: str
    value: str = ""


class SyncplanError(Exception):
    """Base of every error raised on purpose; `exit_code` is the command line's status for it."""

    exit_code = 1


class InputError(SyncplanError):
    """The caller's input can't be used; `key` is the dotted path of the value at fault.

    Parameters
    ----------
    problem : what is wrong, with the value and what is allowed, in one line
    key : dotted path inside the scenario or plan, or the name of an option
    source : file the input came from
    faults : all faults, if there is more than one
    more : number of faults besides those listed
    """

    exit_code = 2

    def __init__(
        self,
        problem: str,
        *,
        key: str = "",
        source: str = "",
        faults: tuple[Fault, ...] = (),
        more: int = 0,
    ) -> None:
        self.problem = problem
        self.key = key
        self.source = source
        self.faults = faults or (Fault(key, problem),)
        self.more = more
        super().__init__(_in_one_line(source, key, problem))
        for line in self.lines()[1:]:
            self.add_note(line)

    @classmethod
    def of(cls, faults: Sequence[Fault], *, source: str = "", more: int = 0) -> "InputError":
        """Return the error of faults, with the message of the first; `more` are not listed."""
        first, others = faults[0], len(faults) - 1 + more
        problem = f"{first.problem} (and {others} more)" if others else first.problem
        problem = f"{first.value}: {problem}" if first.value else problem
        return cls(problem, key=first.key, source=source, faults=tuple(faults), more=more)

    def within(self, section: str) -> "InputError":
        """Return the error with its keys inside `section` of a larger document."""
        faults = (Fault(_joined(section, one.key), one.problem, one.value) for one in self.faults)
        key = _joined(section, self.key)
        return InputError(
            self.problem, key=key, source=self.source, faults=tuple(faults), more=self.more
        )

    def lines(self, options: Mapping[str, str] | None = None) -> list[str]:
        """Return a line for each fault: file, key, value, problem; the last counts those left out.

        `options` are those of a command line, by the key that they set. Faults of such keys name
        the option instead of file and key.
        """
        known = {} if options is None else options
        if len(self.faults) == 1 and not self.more:
            option = known.get(self.key.partition("[")[0])
            return [_in_one_line(option, self.problem) if option else str(self)]
        lines = []
        for one in self.faults[:MOST_LINES]:
            option = known.get(one.key.partition("[")[0])
            place = (option,) if option else (self.source, one.key)
            lines.append(_in_one_line(*place, one.value, one.problem))
        left = len(self.faults) + self.more - len(lines)
        return [*lines, _in_one_line(self.source, f"and {left} more")] if left else lines


class NoGoError(SyncplanError):
    """The plan's verdict stops the request: the plan must not be flown."""

    exit_code = 3


class NoSolutionError(SyncplanError):
    """The request is well formed, but no solution exists or none was found."""

    exit_code = 4


class ProcessEndedError(SyncplanError):
    """A process that computed a share of the result ended before it answered."""


def _in_one_line(*parts: str) -> str:
    text = ": ".join(part for part in parts if part)
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def _joined(section: str, key: str) -> str:
    return f"{section}.{key}" if key else section
