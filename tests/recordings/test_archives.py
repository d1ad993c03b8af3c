"""Recordings in archives, read as their folders are; whatever is broken in either is refused."""

import contextlib
import io
import tarfile
import zipfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.errors import InputError
from syncplan.estimation.replays import replay
from syncplan.recordings import recorded_files
from syncplan.recordings.log import pack_log, unpack_log
from syncplan.recordings.recording_formats import load_log, read_archive
from tests.tools.recorded_bags import write_bag
from tests.tools.recordings import Recipe, assert_same, tarred, write_csv, write_recording, zipped


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    recipe = Recipe(duration=2.0, period=0.1, bearing_sigma=0.05, nobody=2)
    return write_recording(tmp_path_factory.mktemp("archived") / "hall", recipe, seed=3)


def _zipped(files: dict[str, bytes]) -> io.BytesIO:
    return io.BytesIO(zipped(files))


def _tarred(files: dict[str, bytes], kind: str = "") -> io.BytesIO:
    return io.BytesIO(tarred(files, kind))


def _files(folder: Path, at: str = "") -> dict[str, bytes]:
    return {at + path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("kind", ["zip", "", "gz", "xz", "bz2"])
def test_an_archive_holds_what_its_folder_does(kind: str, folder: Path, tmp_path: Path) -> None:
    files = {"./README.md": b"words", ".git/x.csv": b"", "__MACOSX/hall/._Barcodes.dat": b"?"}
    files |= _files(folder, "recorded/hall/")
    stream = _zipped(files) if kind == "zip" else _tarred(files, kind)
    path = tmp_path / "sent"
    path.write_bytes(stream.getvalue())
    assert_same(load_log(path), load_log(folder))


def test_files_at_the_top_are_a_recording(folder: Path) -> None:
    assert read_archive(_zipped(_files(folder))).name == "recording"


def test_archives_hold_every_layout(folder: Path, tmp_path: Path) -> None:
    log = load_log(folder)
    for made in (write_csv(log, tmp_path / "csv"), write_bag(log, tmp_path / "bag")):
        assert_same(read_archive(_tarred(_files(made, f"{made.name}/"))), load_log(made))


def test_a_recording_comes_back_from_its_bytes(folder: Path, tmp_path: Path) -> None:
    for log in (load_log(folder), load_log(write_csv(load_log(folder), tmp_path / "names"))):
        assert_same(unpack_log(pack_log(log)), log)
    for bad in (b"", b"PK", pack_log(log)[:-30]):
        with pytest.raises(InputError, match="not a recording"):
            unpack_log(bad)


def test_a_fault_is_reported_with_the_archive_and_the_file(
    folder: Path, tmp_path: Path, refused: Any
) -> None:
    files = _files(folder, "hall/")
    files["hall/Robot2_Odometry.dat"] = b"1 2 fast\n"
    path = tmp_path / "sent.zip"
    path.write_bytes(_zipped(files).getvalue())
    place = f"{path}: hall/Robot2_Odometry.dat: line 1: turn rate is 'fast'"
    assert place in refused("replay", str(path))
    before = path.read_bytes()
    path.write_bytes(_zipped(_files(folder)).getvalue())
    assert "is the file that is read" in refused("replay", str(path), "-o", str(path))
    assert path.read_bytes() != before


def _refused(stream: io.BytesIO) -> str:
    with pytest.raises(InputError) as refusal:
        read_archive(stream, "sent")
    return str(refusal.value)


def _linked(kind: bytes) -> io.BytesIO:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as archive:
        entry = tarfile.TarInfo("hall/odometry.csv")
        entry.type, entry.linkname = kind, "/etc/passwd"
        archive.addfile(entry)
    return stream


def _linked_in_zip() -> io.BytesIO:
    entry = zipfile.ZipInfo("hall/odometry.csv")
    entry.external_attr = 0o120777 << 16
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr(entry, "/etc/passwd")
    return stream


@pytest.mark.parametrize(
    ("stream", "reported"),
    [
        (_zipped({"../odometry.csv": b""}), "'../odometry.csv' would be written elsewhere"),
        (_tarred({"/etc/odometry.csv": b""}), "'/etc/odometry.csv' would be written elsewhere"),
        (_zipped({"..\\odometry.csv": b""}), "would be written elsewhere; name files by where"),
        (_zipped({"a/odometry.csv": b"", "b/odometry.csv": b""}), "'b/odometry.csv' belongs to a"),
        (_linked(tarfile.SYMTYPE), "'hall/odometry.csv' is no plain file; send the file"),
        (_linked(tarfile.LNKTYPE), "'hall/odometry.csv' is no plain file; send the file"),
        (_linked(tarfile.FIFOTYPE), "'hall/odometry.csv' is no plain file; send the file"),
        (_linked_in_zip(), "'hall/odometry.csv' is no plain file; send the file"),
        (_zipped({"a/b.txt": b""}), "sent: holds none of *.dat, *.csv, metadata.yaml, *.mcap,"),
        (_zipped({"a/other.csv": b""}), "sent: a: is no recording; the folder or archive of one"),
        (_zipped({"a/odometry.csv": b"", "a/Barcodes.dat": b""}), "sent: a: holds 2 recordings"),
        (io.BytesIO(b"no archive at all"), "sent: can't be unpacked: it is neither a zip nor a"),
    ],
)
def test_archives_that_hold_what_they_should_not_are_refused(
    stream: io.BytesIO, reported: str
) -> None:
    assert reported in _refused(stream)


@pytest.mark.parametrize("pack", [_zipped, _tarred])
def test_what_grows_too_large_is_not_unpacked(
    pack: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(recorded_files, "MOST_BYTES", 2**20)
    for name in ("odometry.csv", "words.txt"):
        assert "sent: holds more than 1 MiB, unpacked" in _refused(pack({name: bytes(2**20 + 1)}))
    assert list(tmp_path.iterdir()) == []


def _empty(count: int) -> dict[str, bytes]:
    return {f"hall/{k}.csv": b"" for k in range(count)}


@pytest.mark.parametrize(
    ("kind", "reported"), [("zip", "holds at least 60 files"), ("gz", "holds at least 21 files")]
)
def test_an_archive_of_empty_files_is_refused_by_their_number(
    kind: str, reported: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, refused: Any
) -> None:
    monkeypatch.setattr(recorded_files, "MOST_MEMBERS", 20)
    stream = _zipped(_empty(60)) if kind == "zip" else _tarred(_empty(60), kind)
    remedy = "and folders; allowed is up to 20; leave out what is no recording"
    assert _refused(stream) == f"sent: {reported} {remedy}"
    path = tmp_path / "sent"
    path.write_bytes(stream.getvalue())
    assert f"{path}: {reported} {remedy}" in refused("replay", str(path))
    if kind == "zip":
        # not even its directory is read
        monkeypatch.delattr(zipfile.ZipFile, "infolist")
        assert reported in _refused(stream)


@pytest.mark.parametrize("pack", [_zipped, _tarred])
def test_folders_count_as_members(pack: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded_files, "MOST_MEMBERS", 3)
    assert "holds none of *.dat" in _refused(pack({f"{k}.txt": b"" for k in range(3)}))
    assert "holds at least 4 files and" in _refused(pack({f"{k}.txt": b"" for k in range(4)}))
    stream = io.BytesIO()
    if pack is _zipped:
        stream = pack({f"{k}/": b"" for k in range(4)})
    else:
        with tarfile.open(fileobj=stream, mode="w") as archive:
            for k in range(4):
                entry = tarfile.TarInfo(str(k))
                entry.type = tarfile.DIRTYPE
                archive.addfile(entry)
    assert "holds at least 4 files and folders" in _refused(stream)


@pytest.mark.parametrize("at", [-3, -2, -1, 0])
def test_entries_of_a_directory_are_counted_wherever_a_part_ends(
    at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = _zipped({"a.txt": b"", "b.txt": b"", "c.txt": b""})
    monkeypatch.setattr(recorded_files, "_AT_ONCE", stream.getvalue().find(b"PK\x01\x02") - at)
    monkeypatch.setattr(recorded_files, "MOST_MEMBERS", 2)
    assert "holds at least 3 files" in _refused(stream)


def test_a_size_that_is_stated_too_small_is_found_out() -> None:
    stream = _zipped({"odometry.csv": b"x" * 5000})
    content = bytearray(stream.getvalue())
    for at in (content.find(b"PK\x01\x02") + 24, 22):
        content[at : at + 4] = (10).to_bytes(4, "little")
    assert "can't be unpacked: Bad CRC-32" in _refused(io.BytesIO(bytes(content)))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A short recording in each layout, by the layout's name."""
    folder = tmp_path_factory.mktemp("small")
    recipe = Recipe(duration=0.5, period=0.1, nobody=1)
    written = {"MRCLAM": write_recording(folder / "MRCLAM", recipe)}
    log = load_log(written["MRCLAM"])
    bags = {kind: write_bag(log, folder / kind, kind) for kind in ("MCAP", "SQLITE3")}
    return {**written, "CSV": write_csv(log, folder / "CSV"), **bags}


def _spoilt(data: st.DataObject, before: bytes) -> bytes:
    odd = [b"\n", b" ", b"#", b",", b'"', b"1e400 ", b"\x00", b"nan", b"\r"]
    at, cut = data.draw(st.integers(0, len(before))), data.draw(st.integers(0, 30))
    new = data.draw(st.binary(max_size=12) | st.sampled_from(odd))
    return before[:at] + new + before[at + cut :]


@given(data=st.data())
@pytest.mark.parametrize("layout", ["MRCLAM", "CSV", "MCAP", "SQLITE3"])
def test_whatever_a_file_holds_is_replayed_or_refused(
    layout: str, data: st.DataObject, small: dict[str, Path]
) -> None:
    path = data.draw(st.sampled_from(sorted(small[layout].iterdir())))
    before = path.read_bytes()
    try:
        path.write_bytes(_spoilt(data, before))
        with contextlib.suppress(InputError):
            replay(load_log(small[layout]))
    finally:
        path.write_bytes(before)


def test_a_bag_of_which_no_message_can_be_found_is_refused(
    small: dict[str, Path], tmp_path: Path
) -> None:
    (whole,) = small["MCAP"].glob("*.mcap")
    before, spoilt = whole.read_bytes(), tmp_path / "spoilt.mcap"
    # between the header and the first chunk
    spoilt.write_bytes(before[:71] + bytes(9) + before[71:])
    with pytest.raises(InputError, match=r"spoilt.mcap: holds no messages of any robot"):
        load_log(spoilt)


@given(data=st.data())
@pytest.mark.parametrize("kind", ["zip", "", "gz", "xz"])
def test_whatever_an_archive_holds_is_read_or_refused(
    kind: str, data: st.DataObject, folder: Path
) -> None:
    stream = _zipped(_files(folder)) if kind == "zip" else _tarred(_files(folder), kind)
    with contextlib.suppress(InputError):
        read_archive(io.BytesIO(_spoilt(data, stream.getvalue())))
