"""Pages read as a reader does: every block in order, in a folder of the page's own.

console   lines that begin with "$ " are typed (those that follow with "> " go with them); what
          stands below is compared with what is shown, see tests/tools/likeness.py
yaml      a scenario, a part of one, a brief, or candidate sites; with a title, written to that file
json      parsed; with a title, written to that file
python    run, page by page in one namespace; a block of text after it is what it prints
"""

import contextlib
import io
import json
import os
import re
import shlex
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt

from syncplan.landmarks.site_choice import named_candidates
from syncplan.scenario.brief import brief_of
from syncplan.scenario.loading import parse_values, scenario_from
from syncplan.scenario.specification import Scenario
from tests.tools.likeness import Likeness
from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.serving import ROOT, free_port
from tests.tools.terminal import Terminal

__all__ = ["Block", "Walk", "blocks_of"]

ADDRESS = "127.0.0.1:8000"
SECOND_PORT = "8001"
DATABASE = "postgresql://syncplan:PASSWORD@db.example/syncplan"
NOT_RUN = "data-not-run"

_BASE: dict[str, Any] = {
    "orbit": {"radius_m": 20, "angular_rate_rad_s": 0.2},
    "formation": {"shape": "grid", "count": 6, "columns": 3, "spacing_m": 70},
    "sensor": {"range_m": 50},
}


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block: where it begins, what it is, its options and its text."""

    place: str
    language: str
    options: dict[str, str]
    text: str

    @property
    def not_run(self) -> str | None:
        """Why the block is not run; None if it is."""
        return self.options.get(NOT_RUN)


def blocks_of(page: Path) -> list[Block]:
    """Return the fenced blocks of a page in order."""
    name = page.relative_to(ROOT).as_posix()
    found = []
    for token in MarkdownIt().parse(page.read_text("utf-8")):
        if token.type == "fence" and token.map is not None:
            language, *options = shlex.split(token.info) or [""]
            pairs = dict(option.partition("=")[::2] for option in options)
            found.append(Block(f"{name}:{token.map[0] + 1}", language, pairs, token.content))
    return found


class Walk:
    """One page being followed, in its folder."""

    def __init__(self, folder: Path, *, database: str | None = None) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.port = free_port()
        self._second_port = free_port()
        self._database = database
        self._likeness = Likeness()
        self._names: dict[str, Any] = {"__name__": "__main__"}
        self._printed = ""
        self._terminal = Terminal(folder, self._environment())

    def __enter__(self) -> "Walk":
        return self

    def __exit__(self, *_: object) -> None:
        self._terminal.close()

    def follow(self, block: Block) -> None:
        """Do what a block says; AssertionError says what went otherwise."""
        if block.not_run is not None:
            return
        action = {
            "console": self._type,
            "json": self._keep_json,
            "python": self._execute,
            "text": self._compare_print,
            "yaml": self._keep_yaml,
        }.get(block.language)
        assert action is not None, f"{block.place}: nothing runs a block of {block.language!r}"
        action(block)

    def serve(self) -> None:
        """Start the service, as a reader of `make serve` has done."""
        self._terminal.run("syncplan serve 2> serve.log &")
        url = f"http://127.0.0.1:{self.port}/readyz"
        wait_until(lambda: self._terminal.run(f"curl -sf {url}")[0] == 0, every_s=0.2)

    def _environment(self) -> dict[str, str]:
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("SYNCPLAN_", "COLUMNS"))}
        here = str(Path(sys.executable).parent)
        return {
            **kept,
            "HOME": str(self.folder),
            "NO_COLOR": "1",
            "PATH": f"{here}:{kept['PATH']}",
            "PYTHONPATH": str(ROOT),
            "SYNCPLAN_DATA_DIR": str(self.folder / "data"),
            "SYNCPLAN_PORT": str(self.port),
            "TERM": "dumb",
        }

    def _real(self, text: str) -> str:
        """A page's text with this machine's ports and database."""
        if self._database is not None:
            text = text.replace(DATABASE, self._database)
        text = text.replace(ADDRESS, f"127.0.0.1:{self.port}")
        return text.replace(SECOND_PORT, str(self._second_port))

    # --- console ------------------------------------------------------------------------------

    def _type(self, block: Block) -> None:
        steps = list(_steps(block))
        assert steps, f"{block.place}: no line begins with '$ '"
        for k, (command, written) in enumerate(steps):
            asks = k + 1 < len(steps) and steps[k + 1][0].strip() == "echo $?"
            self._step(block.place, command, written, may_fail=asks)

    def _step(self, place: str, command: str, written: str, *, may_fail: bool) -> None:
        deadline = time.monotonic() + (PATIENCE_S if _only_asks(command) else 0.0)
        while True:
            real = self._likeness.translated(self._real(command))
            status, shown = self._terminal.run(real)
            said = self._real(written)
            alike = not said.strip() or self._likeness.matches(said, shown)
            if (alike and (status == 0 or may_fail)) or time.monotonic() > deadline:
                break
            time.sleep(0.3)
        assert status == 0 or may_fail, f"{place}: $ {command}\nexit status {status}\n{shown}"
        assert alike, f"{place}: $ {command}\nwritten:\n{written}\nshown:\n{shown}"

    # --- files --------------------------------------------------------------------------------

    def _keep_yaml(self, block: Block) -> None:
        _check_yaml(block)
        self._keep(block)

    def _keep_json(self, block: Block) -> None:
        json.loads(block.text)
        self._keep(block)

    def _keep(self, block: Block) -> None:
        if "title" in block.options:
            (self.folder / block.options["title"]).write_text(block.text, encoding="utf-8")

    # --- Python -------------------------------------------------------------------------------

    def _execute(self, block: Block) -> None:
        code = compile(self._real(block.text), block.place, "exec")
        if "title" in block.options:
            # a module, which later blocks import
            self._keep(block)
            return
        printed = io.StringIO()
        path, modules = [*sys.path], {*sys.modules}
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(printed):
            sys.path.insert(0, str(self.folder))
            try:
                exec(code, self._names)
            finally:
                sys.path[:] = path
                for module in (file.stem for file in self.folder.glob("*.py")):
                    if module not in modules:
                        sys.modules.pop(module, None)
        self._printed = printed.getvalue()

    def _compare_print(self, block: Block) -> None:
        alike = self._likeness.matches(block.text, self._printed)
        assert alike, f"{block.place}: written:\n{block.text}\nprinted:\n{self._printed}"


def _steps(block: Block) -> Iterator[tuple[str, str]]:
    """Each command with the output that stands below it."""
    command: list[str] = []
    output: list[str] = []
    going_on = False
    for line in block.text.splitlines():
        if line.startswith("$ "):
            if command:
                yield "\n".join(command), "\n".join(output)
            command, output = [line[2:]], []
        elif command and not output and (going_on or line.startswith("> ")):
            command.append(line.removeprefix("> "))
        else:
            assert command, f"{block.place}: output before any command"
            output.append(line)
        going_on = bool(command) and not output and command[-1].endswith("\\")
    if command:
        yield "\n".join(command), "\n".join(output)


def _only_asks(command: str) -> bool:
    """Whether a command may be repeated until the answer is as written, as a reader would."""
    return command.startswith("curl ") and not re.search(r" (-d|--data\S*|-X) ", command)


def _check_yaml(block: Block) -> None:
    values = parse_values(block.text, block.place)
    if isinstance(values, dict) and set(values) <= set(Scenario.model_fields):
        scenario_from({**_BASE, **values}, source=block.place)
    elif isinstance(values, dict) and "purpose" in values:
        brief_of(values)
    else:
        named_candidates(values, source=block.place)
