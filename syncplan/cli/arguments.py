"""Arguments that commands share: files, formats, and options of runs."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from syncplan.cli.console import Format, check_output
from syncplan.errors import InputError
from syncplan.options import Option, options_of

if TYPE_CHECKING:
    from syncplan.planning.plan_files import Loaded

LARGEST_FILE_BYTES = 2**20

optional = partial(typer.Option, show_default=False)
"""An option that may be left out; its help states the default."""

ScenarioFile = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="Scenario file, YAML or JSON; - is standard input")
]
SubjectFile = Annotated[
    str, typer.Argument(metavar="PLAN|SCENARIO", help="Plan or scenario file; - is standard input")
]
Output = Annotated[Path | None, optional("-o", "--output", help="File to write the JSON to")]
Shown = Annotated[
    Format,
    typer.Option("--format", help="Standard output: auto is a table at a terminal, JSON elsewhere"),
]
Threads = Annotated[int | None, optional(help="Threads; all cores if not given")]
MaxVehicles = Annotated[
    int | None, optional(min=1, help="Accept teams up to this size (default 10000)")
]


def loaded_file(subject: str, output: Path | None, max_vehicles: int | None) -> "Loaded":
    """Return the content of a plan or scenario file; checks first that the output is writable.

    Raises InputError as `check_output` and syncplan.planning.plan_files.load do.
    """
    from syncplan.planning.plan_files import load
    from syncplan.scenario.models import MAX_VEHICLES

    check_output(output, subject)
    return load(subject, max_vehicles=max_vehicles or MAX_VEHICLES)


def beginning_with(names: Iterable[str], *, listed: bool = False) -> Callable[[str], list[str]]:
    """Return a shell completion of names; `listed` options take several with commas."""
    known = tuple(names)

    def completed(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",") if listed else ("", "", incomplete)
        taken = before.split(",")
        return [
            f"{before}{comma}{name}"
            for name in known
            if name.startswith(last) and name not in taken
        ]

    return completed


def numbers(text: str, option: str) -> list[float]:
    """Return the numbers of a comma-separated option; raises InputError naming it."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"{text!r}: must be numbers with commas between, such as 0.2,0.4", key=option
        ) from None


# --- options of runs ------------------------------------------------------------------------------


def takes_options(
    kind: type, *, without: Sequence[str] = ()
) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Return a decorator that adds the options of `kind`, which the command takes as `options`.

    Names, types, defaults and help are those of its fields; fields in `without` are left out.
    """
    offered = [option for option in options_of(kind) if option.name not in without]

    def read(values: Mapping[str, Any]) -> Any:
        return kind(**{option.name: _read(option, values[option.name]) for option in offered})

    return replacing("options", [*map(_parameter, offered)], read)


def replacing(
    name: str, parameters: Sequence[Parameter], read: Callable[[Mapping[str, Any]], Any]
) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Return a decorator that puts parameters in the place of a command's parameter `name`.

    `read` makes the value of that parameter from theirs, by name.
    """

    def with_parameters(command: Callable[..., int]) -> Callable[..., int]:
        @wraps(command)
        def called(**given: Any) -> int:
            values = {parameter.name: given.pop(parameter.name) for parameter in parameters}
            return command(**{name: read(values)}, **given)

        listed: list[Parameter] = []
        for written in signature(command).parameters.values():
            place = [each.replace(kind=written.kind) for each in parameters]
            listed += place if written.name == name else [written]
        setattr(called, "__signature__", signature(command).replace(parameters=listed))  # noqa: B010
        return called

    return with_parameters


@dataclass(frozen=True, slots=True)
class _Written:
    """Notation for values of a type on a command line.

    Attributes
    ----------
    type : type that the parser knows
    read : function from the parser's value and the option's name to the value
    hint : hint on the notation for the help; empty where it is plain
    metavar : placeholder in the help; the parser's own if None
    completed : shell completion
    """

    type: Any
    read: Callable[[Any, str], Any]
    hint: str = ""
    metavar: str | None = None
    completed: Callable[[str], list[str]] | None = None


def _parameter(option: Option) -> Parameter:
    """The parameter of a command that sets an option."""
    written = _WRITTEN.get(option.type, _Written(option.type, lambda value, _: value))
    default = option.default if option.type == written.type else None
    off = f"/--no-{option.flag.removeprefix('--')}" if option.default is True else ""
    shown = typer.Option(
        f"{option.flag}{off}",
        help=f"{option.sentence}{written.hint}",
        show_default=default is not None and option.default is not False,
        metavar=written.metavar,
        autocompletion=written.completed,
        hidden=option.former,
    )
    return Parameter(
        option.name,
        Parameter.KEYWORD_ONLY,
        default=default,
        annotation=Annotated[(written.type, shown)],
    )


def _read(option: Option, value: Any) -> Any:
    """Value of an option, from the parser's value."""
    if value is None:
        return option.default
    written = _WRITTEN.get(option.type)
    return value if written is None else written.read(value, option.flag)


def _pair(text: str, flag: str) -> tuple[float, float]:
    found = numbers(text, flag)
    if len(found) != 2:
        raise InputError(f"{text!r}: give two numbers, such as 1.5,0", key=flag)
    return found[0], found[1]


def _names(text: str, _: str) -> tuple[str, ...] | None:
    if text == "all":
        return None
    return () if text == "none" else tuple(map(str.strip, text.split(",")))


def numeric_keys_from(incomplete: str, before: str = "") -> list[str]:
    """Return the numeric keys after the prefix `before` that begin with `incomplete`."""
    from syncplan.scenario.dotted_keys import numeric_keys

    found = [key.removeprefix(before) for key in numeric_keys() if key.startswith(before)]
    return [key for key in found if key.startswith(incomplete)]


def _true_keys(incomplete: str) -> list[str]:
    from syncplan.scenario.dotted_keys import IN_TRUTH

    return [f"{key}=" for key in numeric_keys_from(incomplete, IN_TRUTH)]


def _truth(texts: Sequence[str], flag: str) -> dict[str, Any] | None:
    """Keys of the simulated world, section by section, from texts of KEY=VALUE."""
    from syncplan.scenario.dotted_keys import IN_TRUTH, nearest_keys, numeric_keys, with_number

    document: dict[str, Any] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not equals:
            problem = f"{text!r}: give a key and its value, such as wind.gust_sigma_mps=0.6"
            raise InputError(problem, key=flag)
        if IN_TRUTH + key not in numeric_keys():
            near = [one.removeprefix(IN_TRUTH) for one in nearest_keys(IN_TRUTH + key)]
            known = [one for one in dict.fromkeys(near) if IN_TRUTH + one in numeric_keys()]
            page = "see docs/how-to/try-a-plan-in-other-worlds.md"
            hint = f"did you mean {' or '.join(known[:3])}?" if known else page
            problem = f"{key!r}: no such key of the simulated world holds a number; {hint}"
            raise InputError(problem, key=flag)
        try:
            document = with_number(document, IN_TRUTH + key, float(value))
        except ValueError:
            problem = f"{value!r}: the value of {key} must be a number"
            raise InputError(problem, key=flag) from None
    return document.get("truth")


def poses_of(text: str, flag: str) -> list[tuple[float, float, float]]:
    """Return poses (m, m, rad) from `1,2,0.5;4,0,-1`, or from a file with a line for each robot.

    Raises InputError if the text is neither such a list nor such a file.
    """
    rows = text.split(";") if ";" in text or "," in text else _lines(Path(text), flag)
    poses = []
    for row in rows:
        try:
            x, y, heading = (float(word) for word in row.replace(",", " ").split())
        except ValueError:
            shown = row.strip()[:60]
            problem = f"{shown!r}: x, y and heading of one robot are needed, in m and rad"
            raise InputError(problem, key=flag) from None
        poses.append((x, y, heading))
    return poses


def _lines(path: Path, flag: str) -> list[str]:
    try:
        if path.stat().st_size > LARGEST_FILE_BYTES:
            raise InputError(f"{path} is larger than a list of poses can be", key=flag)
        lines = path.read_text("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{path} is not a text file", key=flag) from None
    except OSError as error:
        raise InputError(f"{path} can't be read: {error.strerror}", key=flag) from None
    return [line for line in (line.split("#")[0].strip() for line in lines) if line]


_WRITTEN: Mapping[Any, _Written] = {
    tuple[str, ...]: _Written(
        list[str] | None, lambda texts, _: tuple(texts), "; may be given several times"
    ),
    tuple[float, float] | None: _Written(str | None, _pair),
    tuple[int | str, ...] | None: _Written(str | None, _names, "; such as 7,15, or all, or none"),
    Sequence[Sequence[float]] | None: _Written(str | None, poses_of, metavar="FILE|X,Y,RAD;..."),
    Mapping[str, Any] | None: _Written(
        list[str] | None,
        _truth,
        "; such as wind.gust_sigma_mps=0.6, may be given several times",
        metavar="KEY=VALUE",
        completed=_true_keys,
    ),
}
"""Types with a notation other than the parser's."""
