"""Results that can't be written: said at once, before anything is read or computed."""

import os
from pathlib import Path
from typing import Any

import pytest

from syncplan.errors import InputError
from syncplan.runtime.files import check_writable, write_text
from tests.tools.scenarios import FILES

GRID = str(FILES / "paper-grid-same.yaml")

COMMANDS: dict[str, tuple[str, ...]] = {
    "plan": ("plan", "none.yaml"),
    "refine": ("refine", "none.yaml"),
    "place": ("place", "none.yaml"),
    "landmarks": ("landmarks", "none.yaml", "--candidates", "no.yaml", "--choose", "1"),
    "design": ("design", "none.yaml"),
    "validate": ("validate", "none.yaml"),
    "sweep": ("sweep", "none.yaml", "--range", "40,50"),
    "fly": ("fly", "none.yaml"),
    "what-if": ("what-if", "none.yaml"),
    "replay": ("replay", "none"),
    "plot": ("plot", "none.yaml"),
    "export": ("export", "none.yaml", "--format", "csv"),
}
"""Each reads a file that is none: that the output is complained of says that it comes first."""


ENDINGS = {"plot": "html", "export": "zip"}
OUTPUTS = [
    *((name, "-o") for name in COMMANDS),
    ("landmarks", "--scenario-out"),
    ("design", "--plan-out"),
]


def _target(folder: Path, command: str) -> Path:
    return folder / f"x.{ENDINGS.get(command, 'json')}"


@pytest.mark.parametrize(("command", "option"), OUTPUTS)
def test_a_missing_folder_is_said_before_anything_is_read(
    refused: Any, tmp_path: Path, command: str, option: str
) -> None:
    target = _target(tmp_path / "nodir", command)
    err = refused(*COMMANDS[command], option, str(target))
    problem = f"can't be written: there is no directory {target.parent}; make it first"
    assert err == f"syncplan: {target}: {problem}\n"
    assert list(tmp_path.iterdir()) == []


# what replay reads are folders, as a rule
@pytest.mark.parametrize(("command", "option"), [one for one in OUTPUTS if "replay" not in one])
def test_the_file_that_is_read_is_not_written_over(
    refused: Any, tmp_path: Path, command: str, option: str
) -> None:
    target = _target(tmp_path, command)
    target.write_text("{}")
    name, _, *options = COMMANDS[command]
    err = refused(name, str(target), *options, option, str(target))
    assert err == f"syncplan: {target}: is the file that is read; give another one to write\n"
    assert target.read_text() == "{}"


def test_a_file_to_replace_is_as_it_was_after_the_check(refused: Any, tmp_path: Path) -> None:
    target = tmp_path / "x.json"
    target.write_text("mine")
    assert "none.yaml" in refused("fly", "none.yaml", "-o", str(target))
    assert [one.name for one in tmp_path.iterdir()] == ["x.json"]
    assert target.read_text() == "mine"


def test_standard_output_and_devices_need_no_folder(refused: Any) -> None:
    for output in ("-", "/dev/null", "/dev/stdout"):
        assert refused("fly", "none.yaml", "-o", output).startswith("syncplan: none.yaml: ")


def test_what_can_not_be_written_to_is_refused_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shut, read_only = tmp_path / "shut", tmp_path / "kept.json"
    shut.mkdir()
    read_only.write_text("{}")
    barred = {shut, read_only}
    # everything is open to root, who may run this
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) not in barred)
    with pytest.raises(InputError, match=rf"nothing can be written to {shut}; give a file else"):
        check_writable(shut / "x.json")
    with pytest.raises(InputError, match=r"kept\.json: can't be written: it is read-only$"):
        check_writable(read_only)
    with pytest.raises(InputError, match="is a directory; give the name of a file"):
        check_writable(tmp_path)
    with pytest.raises(InputError, match=r"x\.json: can't be written: Not a directory"):
        check_writable(read_only / "x.json")
    with pytest.raises(InputError, match="can't be written: File name too long"):
        check_writable(tmp_path / ("x" * 300))


def test_writing_and_checking_refuse_alike(tmp_path: Path) -> None:
    target = tmp_path / "nodir" / "x.json"
    with pytest.raises(InputError) as checked:
        check_writable(target)
    with pytest.raises(InputError) as written:
        write_text(target, "{}")
    assert str(checked.value) == str(written.value)
