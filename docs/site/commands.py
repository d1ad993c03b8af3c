"""The command line as a page: what each command's --help says, by Typer's own writer."""

import html
import re

import typer
from typer.cli import get_docs_for_click
from typer.main import get_command

from syncplan.cli.command_line import application

__all__ = ["commands_page"]

_INTRODUCTION = """# Command line

Results go to standard output: a table at a terminal, JSON elsewhere (`--format` chooses). A file
named with `-o` is written whole or not at all. Messages and progress go to standard error. `-` in
place of a file is standard input.

| exit status | meaning |
|---|---|
| 0 | done |
| 1 | internal fault |
| 2 | bad input: one line with file, key, value and what is allowed |
| 3 | with `--require-observable`: the plan is not observable |
| 4 | no solution, or nothing better than what was given: nothing is written over |
| 130 | interrupted |

"""


def commands_page() -> str:
    """Return the page of all commands, in the order of the command line."""
    command = get_command(application())
    written = get_docs_for_click(obj=command, ctx=typer.Context(command), name="syncplan")
    body = html.unescape(written).partition("\n")[2]
    # examples are typed as they stand
    return _INTRODUCTION + re.sub(r"^Example: (.+)$", r"Example: `\1`", body, flags=re.MULTILINE)
