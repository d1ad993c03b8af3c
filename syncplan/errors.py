"""The errors syncplan raises on purpose; a message names the object, its value and a remedy."""

from dataclasses import dataclass

__all__ = ["Fault", "InputError", "NoGoError", "NoSolutionError", "SyncplanError"]


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing wrong with the input.

    Attributes
    ----------
    key : dotted path inside the document, or the name of an option
    problem : what is wrong, and what is allowed, in one line
    value : what was given, as short JSON; empty where there is none
    """

    key: str
    problem: str
    value: str = ""


class SyncplanError(Exception):
    """Base of every error raised on purpose; `exit_code` is the command line's status for it."""

    exit_code = 1


class InputError(SyncplanError):
    """The caller's input can't be used: `key` is the dotted path of what is at fault.

    Parameters
    ----------
    problem : what is wrong, with the value and what is allowed, in one line
    key : dotted path inside the scenario or plan, or the name of an option
    source : file the input came from
    faults : everything that is wrong, where there is more than one thing
    """

    exit_code = 2

    def __init__(
        self, problem: str, *, key: str = "", source: str = "", faults: tuple[Fault, ...] = ()
    ) -> None:
        self.problem = problem
        self.key = key
        self.source = source
        self.faults = faults or (Fault(key, problem),)
        message = ": ".join(part for part in (source, key, problem) if part)
        super().__init__("".join(c if c.isprintable() else ascii(c)[1:-1] for c in message))

    def within(self, section: str) -> "InputError":
        """Return the error with its keys inside `section` of a larger document."""
        faults = (Fault(_joined(section, one.key), one.problem, one.value) for one in self.faults)
        key = _joined(section, self.key)
        return InputError(self.problem, key=key, source=self.source, faults=tuple(faults))


class NoGoError(SyncplanError):
    """The plan's verdict stops what was asked for: a plan that is not to be flown."""

    exit_code = 3


class NoSolutionError(SyncplanError):
    """The request is well formed, but no solution exists or none was found."""

    exit_code = 4


def _joined(section: str, key: str) -> str:
    return f"{section}.{key}" if key else section
