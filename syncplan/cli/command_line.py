"""The command line: its commands, and the exit status of each error."""

import atexit
import gc
import os
import signal
import sys
import threading
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Literal, NoReturn

import typer
from typer.exceptions import TyperException

from syncplan import __version__
from syncplan.cli.arguments import Output
from syncplan.cli.console import Format, deliver, open_closed_streams, reader_may_leave, say
from syncplan.cli.document_table import DOCUMENTS
from syncplan.errors import InputError, SyncplanError
from syncplan.runtime.machine import defer_garbage
from syncplan.studies.study_table import STUDIES

INTERNAL_FAULT = 1
INTERRUPTED = 130

GROUPS = {
    "import_commands.importers": ("import",),
    "plan_commands.plans": ("plan", "refine", "place", "landmarks"),
    "design_commands.designs": ("design",),
    "run_commands.runs": tuple(study.verb for study in STUDIES.values() if study.example),
    "run_commands.sweeps": ("sweep",),
    "plan_commands.losses": ("what-if",),
    "run_commands.replays": ("replay",),
    "plot_commands.plots": ("plot", "report"),
    "export_commands.exporters": ("export",),
    "service_commands.services": ("serve", "worker"),
}
"""Commands by module and name of their group, in the order of the help."""

JSON_SCHEMA = "https://json-schema.org/draft/2020-12/schema"

schemas = typer.Typer()


if TYPE_CHECKING:
    Contract = str
else:
    Contract = Literal[*(name for name, kind in DOCUMENTS.items() if kind.published)]


@schemas.command(name="schema", epilog="\b\nExample: syncplan schema scenario")
def _schema(
    contract: Annotated[Contract, typer.Argument(help="Which document")] = "scenario",
    output: Output = None,
) -> int:
    """Print the JSON Schema of a document."""
    kind = DOCUMENTS[contract]
    schema = kind.model.model_json_schema(mode=kind.mode)
    deliver({"$schema": JSON_SCHEMA, **schema}, output, Format.json, None)
    return 0


def _version(
    version: Annotated[bool, typer.Option("--version", help="Print the version")] = False,
) -> None:
    if version:
        sys.stdout.write(f"syncplan {__version__}\n")
        raise typer.Exit


def application(command: str = "") -> typer.Typer:
    """Return the command line; with the group of `command` alone, as the others load slowly."""
    app = typer.Typer(
        name="syncplan",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        help="Synchronised circular orbits that let a team of robots localise itself.",
        epilog="\b\nExample: syncplan plan examples/scenarios/paper-grid-same.yaml -o plan.json",
    )
    known = [group for group, names in GROUPS.items() if command in names]
    for group in known or GROUPS:
        module, _, name = group.partition(".")
        app.add_typer(getattr(import_module(f"{__package__}.{module}"), name))
    if not known:
        app.add_typer(schemas)
    app.callback(invoke_without_command=True)(_version)
    return app


def _options() -> dict[str, str]:
    """Options by the name of the library's argument that they set."""
    from syncplan.exporting.format_table import ExportOptions
    from syncplan.options import RunOptions, options_of
    from syncplan.plotting.figure_style import FigureStyle

    names = (
        *("losses", "threads", "vary", "center_box_m", "radius_m", "objective", "margin_m"),
        *("time_limit_s", "starts", "choose", "figure", "compare", "theme", "output"),
        "format",
    )
    return {
        **{
            one.name: one.flag
            for kind in (*(study.options for study in STUDIES.values()), ExportOptions, FigureStyle)
            if kind is FigureStyle or issubclass(kind, RunOptions)
            for one in options_of(kind)
            if one.name not in ("filter", "truth")
        },
        **{name: f"--{name.replace('_', '-')}" for name in names},
        "margin": "--margin-m",
    }


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and exit: 0 done, 1 internal fault, 2 bad input, 3, 4 as documented."""
    status: object = 0
    given = sys.argv[1:] if arguments is None else arguments
    defer_garbage()
    # it is not looked for at the end either
    atexit.register(gc.freeze)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _interrupt)
    try:
        open_closed_streams()
        with reader_may_leave():
            status = application(*given[:1])(arguments, standalone_mode=False)
    except InputError as error:
        for line in error.lines(_options()):
            say(line)
        status = error.exit_code
    except SyncplanError as error:
        say(str(error))
        status = error.exit_code
    except TyperException as error:
        if error.format_message():
            say(_usage_fault(error, given))
        status = error.exit_code
    except (KeyboardInterrupt, typer.Abort):
        status = INTERRUPTED
    except MemoryError:
        say("out of memory: the team or the window is too large for this machine")
        status = INTERNAL_FAULT
    except OSError as error:
        # all files are read and written elsewhere: this is standard output
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        say(f"standard output: can't be written: {error.strerror}")
        status = InputError.exit_code
    except Exception as error:
        if os.environ.get("SYNCPLAN_DEBUG"):
            raise
        where = f"{type(error).__name__}: {error}"
        say(f"internal fault, {where} (SYNCPLAN_DEBUG=1 shows where; please report it)")
        status = INTERNAL_FAULT
    if status == INTERRUPTED:
        say("interrupted; nothing was written")
    sys.exit(status if isinstance(status, int) else 0)


def _interrupt(*_: object) -> None:
    """Do as at Ctrl-C, also where a shell has Ctrl-C ignored: searches write the best they have."""
    handler = signal.getsignal(signal.SIGINT)
    (handler if callable(handler) else signal.default_int_handler)(signal.SIGINT, None)


def _usage_fault(error: TyperException, arguments: list[str]) -> str:
    """Message of a wrong argument in one line, with its value if the parser does not repeat it."""
    message = " ".join(error.format_message().split())
    for name in getattr(getattr(error, "param", None), "opts", []):
        for k, given in enumerate(arguments):
            value = None
            if given == name and k + 1 < len(arguments):
                value = arguments[k + 1]
            elif given.startswith(f"{name}="):
                value = given.partition("=")[2]
            if value is not None and repr(value) not in message:
                return f"{name}: {value!r}: {message}"
    return message
