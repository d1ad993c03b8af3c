"""Help at any width: names of options and examples are whole."""

import re
from typing import Any

import pytest
from typer.main import get_command

from syncplan.cli.command_line import GROUPS, application

COMMANDS = [name for names in GROUPS.values() for name in names]


@pytest.mark.parametrize("width", [60, 80, 119, 160])
@pytest.mark.parametrize("name", COMMANDS)
def test_help_cuts_no_names(
    name: str, width: int, printed: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    text = printed(name, "--help")
    command: Any = get_command(application())
    lines = text.splitlines()
    for parameter in command.commands[name].params:
        if getattr(parameter, "hidden", False):
            continue
        for option in filter(lambda one: one.startswith("-"), parameter.opts):
            assert re.search(rf"(?<![\w-]){option}(?![\w-])", text), option
    assert "…" not in text
    assert any(line.lstrip().startswith("Example: ") for line in lines)
    # what is longer than the window stays on its line: examples, to be copied, and lists of names
    assert max(len(line) for line in lines if "Example" not in line and "|" not in line) <= width
