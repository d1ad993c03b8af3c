"""Holdings of owners: plans, recordings, and the answers given to their requests.

A stored plan consists of the bytes of the library's plan and the values added on storing it. A
request that is repeated with its Idempotency-Key gets the earlier answer.
"""

import hashlib
import json
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Exists,
    Row,
    Table,
    bindparam,
    case,
    delete,
    exists,
    false,
    func,
    insert,
    select,
    true,
    update,
)
from sqlalchemy.exc import IntegrityError

from api.documents import PackedRecording, PlanText
from api.problems import StorageFull
from api.storage.tables import NOW, answers, jobs, newest, next_id, plans, recordings
from syncplan.studies.job_contract import UNFINISHED


def check_room(connection: Connection, table: Table, owner: str, most: int) -> None:
    """Raise StorageFull if an owner has `most` rows of a table, plans or recordings."""
    counted = select(table.c.id).where(table.c.owner == owner).limit(most).subquery()
    if connection.execute(select(func.count()).select_from(counted)).scalar_one() >= most:
        raise StorageFull(f"you have {most} stored {table.name}, the most allowed; delete some")


# --- plans ----------------------------------------------------------------------------------------


_PLANS_AT_ONCE = 100


@dataclass(frozen=True, slots=True)
class PlanRow:
    """A stored plan; `text` is the content of its file."""

    id: str
    parent_id: str | None
    created_at: str
    etag: str
    text: str


# a plan's text begins with its version and, unless it is of an early one, its verdict
_HEAD = func.substr(plans.c.text, 1, 120)
_GO = case((_HEAD.contains('"go": true'), true()), (_HEAD.contains('"go": false'), false()))
_LISTED = (
    *(column for column in plans.c if column.name not in ("owner", "etag", "text")),
    _GO.label("go"),
)
_ADD = insert(plans)
_COLUMNS = tuple(plans.c[name] for name in PlanRow.__dataclass_fields__)
# built once: building a statement takes longer than running it
_FIND = select(plans.c.owner, *_COLUMNS).where(plans.c.id.in_(bindparam("ids", expanding=True)))


def add_plan(
    connection: Connection,
    owner: str,
    made: PlanText,
    *,
    plan_id: str | None = None,
    parent_id: str | None = None,
) -> PlanRow:
    """Store a plan, under a new identifier if none is given, and return it."""
    following, created_at = next_id(connection, plans, owner)
    row = PlanRow(
        id=plan_id or following,
        parent_id=parent_id,
        created_at=created_at,
        etag=_etag(made.text),
        text=made.text,
    )
    connection.execute(_ADD, {**asdict(row), **asdict(made), "owner": owner})
    return row


def _etag(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def find_plans(connection: Connection, wanted: Sequence[tuple[str, str]]) -> list[PlanRow | None]:
    """Return the plan of each (owner, identifier), or None in its place, with one statement."""
    identifiers = list({plan_id for _, plan_id in wanted})
    found = connection.execute(_FIND, {"ids": identifiers}).all()
    rows = {(row[0], row[1]): PlanRow(*row[1:]) for row in found}
    return [rows.get(one) for one in wanted]


def list_plans(
    connection: Connection, owner: str, limit: int, before: str | None
) -> Sequence[Row[*tuple[Any, ...]]]:
    """Return summaries of up to `limit` of an owner's plans, newest first, older than `before`."""
    return newest(connection, plans, select(*_LISTED), owner, limit, before)


def rename_plan(
    connection: Connection, owner: str, plan_id: str, tags: Collection[str], name: str, text: str
) -> PlanRow | None:
    """Store an owner's plan with one of these tags under another name and return it.

    Returns None if it is gone or has another tag.
    """
    mine = update(plans).where(_tagged(owner, plan_id, tags))
    values = {"name": name, "text": text, "etag": _etag(text)}
    renamed = connection.execute(mine.values(values).returning(*_COLUMNS)).first()
    return None if renamed is None else PlanRow(*renamed)


def delete_plan(connection: Connection, owner: str, plan_id: str, tags: Collection[str]) -> bool:
    """Delete an owner's plan if it has one of these tags; return whether it was there."""
    return bool(connection.execute(delete(plans).where(_tagged(owner, plan_id, tags))).rowcount)


def _tagged(owner: str, plan_id: str, tags: Collection[str]) -> ColumnElement[bool]:
    """Condition of an owner's plan that has one of these tags; any tag if they contain "*"."""
    mine = (plans.c.id == plan_id) & (plans.c.owner == owner)
    return mine if "*" in tags else mine & plans.c.etag.in_(tags)


def forget_plans(connection: Connection, older_than: str) -> None:
    """Delete the oldest plans, a hundred at most, that were made before a time."""
    oldest = select(plans.c.id).where(plans.c.created_at < older_than).order_by(plans.c.id)
    connection.execute(delete(plans).where(plans.c.id.in_(oldest.limit(_PLANS_AT_ONCE))))


def body_of(row: PlanRow) -> str:
    """Return the plan's own bytes with id, created_at and parent_id added at its top."""
    added = {"id": row.id, "created_at": row.created_at, "parent_id": row.parent_id}
    # as json.dumps with indent=1 writes it, which takes ten times as long
    lines = [f' "{name}": {json.dumps(value)},' for name, value in added.items()]
    return "\n".join(["{", *lines]) + row.text[1:]


# --- recordings -----------------------------------------------------------------------------------


_RECORDINGS_AT_ONCE = 20


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
    following = next_id(connection, recordings, owner)
    row = RecordingRow(*following, len(packed.data), packed.overview)
    values = {**asdict(row), "owner": owner, "data": packed.data}
    connection.execute(insert(recordings).values(values))
    return row


def find_recording(connection: Connection, owner: str, recording_id: str) -> RecordingRow | None:
    """Return an owner's recording, or None."""
    query = select(*_SHOWN).where(recordings.c.id == recording_id, recordings.c.owner == owner)
    found = connection.execute(query).first()
    return None if found is None else RecordingRow(*found)


def rename_recording(
    connection: Connection, owner: str, recording_id: str, overview: str
) -> RecordingRow | None:
    """Store another overview of an owner's recording and return it; None if it is gone."""
    mine = update(recordings).where(recordings.c.id == recording_id, recordings.c.owner == owner)
    found = connection.execute(mine.values(overview=overview).returning(*_SHOWN)).first()
    return None if found is None else RecordingRow(*found)


def list_recordings(
    connection: Connection, owner: str, limit: int, before: str | None
) -> list[RecordingRow]:
    """Return up to `limit` of an owner's recordings, newest first, older than `before`."""
    found = newest(connection, recordings, select(*_SHOWN), owner, limit, before)
    return [RecordingRow(*row) for row in found]


def delete_recording(connection: Connection, owner: str, recording_id: str) -> bool:
    """Delete an owner's recording unless a job still needs it; return whether it is gone."""
    mine = (recordings.c.id == recording_id) & (recordings.c.owner == owner)
    connection.execute(delete(recordings).where(mine, ~_needed()))
    return find_recording(connection, owner, recording_id) is None


def forget_recordings(connection: Connection, older_than: str) -> None:
    """Delete a few of the oldest recordings made before a time that no job still needs."""
    oldest = select(recordings.c.id).where(recordings.c.created_at < older_than, ~_needed())
    old = connection.execute(oldest.order_by(recordings.c.id).limit(_RECORDINGS_AT_ONCE)).scalars()
    connection.execute(delete(recordings).where(recordings.c.id.in_(list(old))))


def _needed() -> Exists:
    """Condition that a job about a recording has not ended."""
    return exists().where(jobs.c.recording_id == recordings.c.id, jobs.c.state.in_(UNFINISHED))


# --- answers --------------------------------------------------------------------------------------


class AnswerTakenError(Exception):
    """Another request with the same key was answered in the meantime."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A response given earlier; `request_digest` identifies the request it answered."""

    request_digest: str
    status: int
    headers: dict[str, str]
    body: str


def find_answer(connection: Connection, owner: str, key: str) -> Answer | None:
    """Return the answer given to an owner's key, or None."""
    query = select(answers).where(answers.c.owner == owner, answers.c.key == key)
    row = connection.execute(query).first()
    if row is None:
        return None
    return Answer(row.request_digest, row.status, json.loads(row.headers), row.body)


def keep_answer(connection: Connection, owner: str, key: str, answer: Answer) -> None:
    """Keep an answer; raises AnswerTakenError if there is one for the key already."""
    values = {**asdict(answer), "headers": json.dumps(answer.headers)}
    try:
        connection.execute(insert(answers).values(owner=owner, key=key, created_at=NOW, **values))
    except IntegrityError:
        raise AnswerTakenError from None


def forget_answers(connection: Connection, older_than: str) -> None:
    """Delete answers given before a time."""
    connection.execute(delete(answers).where(answers.c.created_at < older_than))
