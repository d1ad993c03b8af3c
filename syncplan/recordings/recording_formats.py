"""The table of recording layouts. A new layout is a module that reads it and a line here.

Importing this module is cheap: a layout's own module is loaded when first used.
"""

import io
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, get_args

from syncplan.errors import InputError

if TYPE_CHECKING:
    from syncplan.recordings.log import Log

Stamps = Literal["header", "received"]
"""Which times the readings of a recording have."""

STAMPS = "Times of a bag: of message headers, or of their receipt"


@dataclass(frozen=True, slots=True)
class RecordingFormat:
    """A layout of recordings.

    Attributes
    ----------
    title : name of the layout
    sign : a file that identifies it
    files : patterns of its file names
    detector, reader : module of this package and a function in it, from a path to whether it holds
        this layout, and from a path to the recording
    received : whether readings have a time of receipt besides their stamp
    """

    title: str
    sign: str
    files: tuple[str, ...]
    detector: str
    reader: str
    received: bool = False

    def detects(self, path: Path) -> bool:
        """Return whether a folder or file holds this layout; raises OSError if it can't be read."""
        return bool(_function(self.detector)(path))

    def read(self, path: Path, stamps: Stamps) -> "Log":
        """Return the recording; raises InputError naming file, line and fault."""
        from syncplan.recordings.log import tidied

        known = get_args(Stamps) if self.received else ("header",)
        if stamps not in known:
            problem = f"{stamps!r} given; {self.title} recordings have {' or '.join(known)}"
            raise InputError(problem, key="stamps")
        reader = _function(self.reader)
        return tidied(reader(path, stamps=stamps) if self.received else reader(path))


FORMATS: Mapping[str, RecordingFormat] = MappingProxyType(
    {
        "mrclam": RecordingFormat(
            title="MRCLAM",
            sign="Robot1_Odometry.dat",
            files=("*.dat",),
            detector="mrclam.holds_mrclam",
            reader="mrclam.read_mrclam",
        ),
        "csv": RecordingFormat(
            title="CSV",
            sign="odometry.csv",
            files=("*.csv",),
            detector="csv_layout.holds_csv",
            reader="csv_layout.read_csv",
        ),
        "rosbag2": RecordingFormat(
            title="ROS 2 bag",
            sign="metadata.yaml",
            files=("metadata.yaml", "*.mcap", "*.db3"),
            detector="ros_bags.holds_bag",
            reader="ros_bags.read_bag",
            received=True,
        ),
    }
)
"""All layouts by name."""


def load_log(path: str | Path, *, stamps: Stamps = "header") -> "Log":
    """Return the recording in a folder, a bag's file or an archive, whatever its layout.

    The times of a bag are those of message headers, or of receipt with `stamps` "received". Raises
    InputError naming file, line and fault, and if there is no recording, or two.
    """
    path = Path(path)
    layout = _format_of(path)
    if layout is not None:
        return layout.read(path, stamps)
    with path.open("rb") as stream:
        return read_archive(stream, str(path), stamps=stamps)


def read_archive(stream: BinaryIO, source: str = "", *, stamps: Stamps = "header") -> "Log":
    """Return the recording in a zip or tar archive; messages name `source`.

    Times are those that `load_log` reads. Raises InputError as it and `unpack_files` do.
    """
    from syncplan.recordings.recorded_files import unpack_files

    names = [name for one in FORMATS.values() for name in one.files]
    with TemporaryDirectory(prefix="syncplan-") as scratch:
        folder = unpack_files(stream, Path(scratch), names, source)
        try:
            layout = _format_of(folder)
            assert layout is not None
            return layout.read(folder, stamps)
        except InputError as error:
            # the reader's source, without the temporary folder
            inner = error.source.replace(str(folder), folder.name, 1)
            place = ": ".join(filter(None, (source, inner)))
            raise InputError(error.problem, source=place, key=error.key) from None


def archived(path: Path) -> bytes:
    """Return a recording as the bytes of an archive, zipped unless it is one already.

    Checks no more than the names of the files. Raises InputError as `load_log` does.
    """
    layout = _format_of(path)
    if layout is None:
        return path.read_bytes()
    stream, title = io.BytesIO(), path.resolve().stem if path.is_file() else path.resolve().name
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for one in recorded_files_in(path):
            archive.write(one, f"{title}/{one.name}")
    return stream.getvalue()


def recorded_files_in(path: Path) -> list[Path]:
    """Return the files of the recordings in a folder; a file alone is returned as it is."""
    if not path.is_dir():
        return [path]
    return [one for layout in FORMATS.values() for name in layout.files for one in path.glob(name)]


def _format_of(path: Path) -> RecordingFormat | None:
    """Layout of a folder or file, None for an archive."""
    from syncplan.recordings.recorded_files import holds_archive

    try:
        path.stat()
        found = [one for one in FORMATS.values() if one.detects(path)]
        if not found and holds_archive(path):
            return None
    except FileNotFoundError:
        raise InputError("no such file or folder; check the path", source=str(path)) from None
    except OSError as error:
        raise InputError(f"can't be read: {error.strerror}", source=str(path)) from None
    if len(found) == 1:
        return found[0]
    if found:
        problem = f"holds {len(found)} recordings, {_signs(found)}; keep each in its own folder"
        raise InputError(problem, source=str(path))
    problem = f"is no recording; the folder or archive of one holds {_signs(FORMATS.values())}"
    raise InputError(problem, source=str(path))


def _signs(layouts: Iterable[RecordingFormat]) -> str:
    return ", ".join(f"{one.sign} ({one.title})" for one in layouts)


def _function(name: str) -> Any:
    module, _, function = name.partition(".")
    return getattr(import_module(f"{__package__}.{module}"), function)
