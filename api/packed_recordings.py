"""Recordings as requests send them, and as they are stored."""

import io
import json
from dataclasses import asdict, dataclass, replace

from syncplan.errors import InputError
from syncplan.recordings.log import Overview


@dataclass(frozen=True, slots=True)
class PackedRecording:
    """A recording as bytes of syncplan.recordings.log, and in short, as JSON."""

    data: bytes
    overview: str


def packed_recording(body: bytes, name: str | None) -> PackedRecording:
    """Return the recording in an archive, under a name of its own if one is given.

    Raises InputError, whose key is the file at fault.
    """
    from syncplan.recordings.log import overview_of, pack_log
    from syncplan.recordings.recording_formats import read_archive

    try:
        log = read_archive(io.BytesIO(body))
    except InputError as error:
        raise InputError(error.problem, key=error.source) from None
    named = log if name is None else replace(log, name=name)
    return PackedRecording(pack_log(named), json.dumps(asdict(overview_of(named))))


def overview_of_text(text: str) -> Overview:
    """Return a recording in short, as it is stored."""
    values = json.loads(text)
    lists = {key: tuple(one) for key, one in values.items() if isinstance(one, list)}
    return Overview(**{**values, **lists})
