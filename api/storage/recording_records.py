"""Recordings kept: their bytes, and what lists show of them."""

from dataclasses import dataclass

from sqlalchemy import Connection, Exists, delete, exists, func, insert, select

from api.packed_recordings import PackedRecording
from api.storage.clock import moment, new_id
from api.storage.tables import jobs, recordings
from syncplan.reports.job_contract import UNFINISHED

_FORGOTTEN_AT_ONCE = 20


@dataclass(frozen=True, slots=True)
class RecordingRow:
    """A stored recording as answers show it; `overview` is JSON, `size` in bytes."""

    id: str
    created_at: str
    size: int
    overview: str


_SHOWN = tuple(recordings.c[name] for name in RecordingRow.__dataclass_fields__)


def add_recording(connection: Connection, owner: str, packed: PackedRecording) -> RecordingRow:
    """Store a recording and return it."""
    created_at = moment(connection)
    row = RecordingRow(new_id(created_at), created_at, len(packed.data), packed.overview)
    connection.execute(
        insert(recordings).values(
            id=row.id,
            owner=owner,
            created_at=created_at,
            size=row.size,
            overview=row.overview,
            data=packed.data,
        )
    )
    return row


def find_recording(connection: Connection, owner: str, recording_id: str) -> RecordingRow | None:
    """Return an owner's recording, or None."""
    query = select(*_SHOWN).where(recordings.c.id == recording_id, recordings.c.owner == owner)
    found = connection.execute(query).first()
    return None if found is None else RecordingRow(*found)


def list_recordings(
    connection: Connection, owner: str, limit: int, before: str | None
) -> list[RecordingRow]:
    """Return up to `limit` of an owner's recordings, newest first, older than `before`."""
    query = select(*_SHOWN).where(recordings.c.owner == owner).order_by(recordings.c.id.desc())
    if before is not None:
        query = query.where(recordings.c.id < before)
    return [RecordingRow(*row) for row in connection.execute(query.limit(limit))]


def count_recordings(connection: Connection, owner: str) -> int:
    """Return how many recordings an owner has."""
    query = select(func.count()).select_from(recordings).where(recordings.c.owner == owner)
    return connection.execute(query).scalar_one()


def recording_data(connection: Connection, recording_id: str) -> bytes | None:
    """Return the bytes of a recording, or None where it is gone."""
    query = select(recordings.c.data).where(recordings.c.id == recording_id)
    return connection.execute(query).scalar()


def delete_recording(connection: Connection, owner: str, recording_id: str) -> bool:
    """Delete an owner's recording unless a job still needs it; return whether it is gone."""
    mine = (recordings.c.id == recording_id) & (recordings.c.owner == owner)
    connection.execute(delete(recordings).where(mine, ~_needed()))
    return find_recording(connection, owner, recording_id) is None


def forget_recordings(connection: Connection, older_than: str) -> None:
    """Delete the oldest recordings made before a time, a few at once, that no job still needs."""
    oldest = select(recordings.c.id).where(recordings.c.created_at < older_than, ~_needed())
    old = connection.execute(oldest.order_by(recordings.c.id).limit(_FORGOTTEN_AT_ONCE)).scalars()
    connection.execute(delete(recordings).where(recordings.c.id.in_(list(old))))


def _needed() -> Exists:
    """Whether a job that has not ended is about a recording."""
    return exists().where(jobs.c.recording_id == recordings.c.id, jobs.c.state.in_(UNFINISHED))
