"""Scratch folders: one for each child, gone with it; those of dead owners are swept."""

import multiprocessing
import os
import tempfile
import time
from pathlib import Path

import pytest

from api.computing.scratch import Scratch, sweep


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of temporary files."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def aged(folder: Path) -> None:
    """Make the folders in a folder two minutes old."""
    for inner in folder.iterdir():
        os.utime(inner, (time.time() - 120.0,) * 2)


def test_a_folder_is_removed_with_all_that_is_in_it(folder: Path) -> None:
    scratch = Scratch()
    (Path(scratch.folder) / "inner").mkdir()
    (Path(scratch.folder) / "inner" / "file").write_text("text")
    for _ in range(2):
        scratch.remove()
        assert list(folder.iterdir()) == []


def leave(folder: str) -> None:
    """End without removing a scratch folder."""
    tempfile.tempdir = folder
    (Path(Scratch().folder) / "file").write_text("text")
    os._exit(0)


def test_folders_of_dead_owners_are_swept_and_no_others(folder: Path) -> None:
    scratch = Scratch()
    process = multiprocessing.get_context("spawn").Process(target=leave, args=(str(folder),))
    process.start()
    process.join()
    (folder / "of-others").mkdir()
    os.mkfifo(folder / "syncplan-scratch-x")
    sweep()
    # it may be a folder that is about to be locked
    assert len(list(folder.iterdir())) == 4
    aged(folder)
    sweep()
    assert {inner.name for inner in folder.iterdir()} == {
        "of-others",
        "syncplan-scratch-x",
        Path(scratch.folder).name,
    }
    scratch.remove()
