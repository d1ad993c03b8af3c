"""Plans kept: the bytes of the library's plan, and what was added when they were stored."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, bindparam, delete, func, insert, select

from api.plan_texts import PlanText
from api.storage.clock import moment, new_id
from api.storage.tables import plans

_FORGOTTEN_AT_ONCE = 100


@dataclass(frozen=True, slots=True)
class PlanRow:
    """A stored plan; `text` is the plan as a file of it would hold it."""

    id: str
    parent_id: str | None
    created_at: str
    etag: str
    text: str


_LISTED = (
    plans.c.id,
    plans.c.parent_id,
    plans.c.created_at,
    plans.c.name,
    plans.c.vehicles,
    plans.c.observable,
    plans.c.predicted_rms_m,
)
_ADD = insert(plans)
# built once: building a statement takes longer than carrying it out
_FIND = select(
    plans.c.owner, plans.c.id, plans.c.parent_id, plans.c.created_at, plans.c.etag, plans.c.text
).where(plans.c.id.in_(bindparam("ids", expanding=True)))


def add_plan(
    connection: Connection,
    owner: str,
    made: PlanText,
    *,
    plan_id: str | None = None,
    parent_id: str | None = None,
) -> PlanRow:
    """Store a plan, under a new identifier if none is given, and return it."""
    created_at = moment(connection)
    row = PlanRow(
        id=plan_id or new_id(created_at),
        parent_id=parent_id,
        created_at=created_at,
        etag=hashlib.sha256(made.text.encode()).hexdigest(),
        text=made.text,
    )
    values = {
        "id": row.id,
        "owner": owner,
        "parent_id": parent_id,
        "created_at": row.created_at,
        "name": made.name,
        "vehicles": made.vehicles,
        "observable": made.observable,
        "predicted_rms_m": made.predicted_rms_m,
        "etag": row.etag,
        "text": row.text,
    }
    connection.execute(_ADD, values)
    return row


def find_plans(connection: Connection, wanted: Sequence[tuple[str, str]]) -> list[PlanRow | None]:
    """Return the plan of each (owner, identifier), or None in its place, by one statement."""
    identifiers = list({plan_id for _, plan_id in wanted})
    found = connection.execute(_FIND, {"ids": identifiers}).all()
    rows = {(row[0], row[1]): PlanRow(*row[1:]) for row in found}
    return [rows.get(one) for one in wanted]


def list_plans(
    connection: Connection, owner: str, limit: int, before: str | None
) -> list[dict[str, Any]]:
    """Return summaries of up to `limit` of an owner's plans, newest first, older than `before`."""
    query = select(*_LISTED).where(plans.c.owner == owner).order_by(plans.c.id.desc())
    if before is not None:
        query = query.where(plans.c.id < before)
    return [dict(row) for row in connection.execute(query.limit(limit)).mappings()]


def delete_plan(connection: Connection, owner: str, plan_id: str) -> None:
    """Delete an owner's plan, if it is there."""
    connection.execute(delete(plans).where(plans.c.id == plan_id, plans.c.owner == owner))


def has_room(connection: Connection, owner: str, most: int) -> bool:
    """Return whether an owner has fewer than `most` plans."""
    counted = select(plans.c.id).where(plans.c.owner == owner).limit(most).subquery()
    return connection.execute(select(func.count()).select_from(counted)).scalar_one() < most


def forget_plans(connection: Connection, older_than: str) -> None:
    """Delete the oldest plans, a hundred at most, as far as they were made before a time."""
    # by identifiers, which are ordered by time: nothing else is indexed
    oldest = select(plans.c.id, plans.c.created_at).order_by(plans.c.id).limit(_FORGOTTEN_AT_ONCE)
    old = [one for one, created_at in connection.execute(oldest) if created_at < older_than]
    if old:
        connection.execute(delete(plans).where(plans.c.id.in_(old)))


def body_of(row: PlanRow) -> str:
    """Return the plan's own bytes with id, created_at and parent_id added at its top."""
    added = {"id": row.id, "created_at": row.created_at, "parent_id": row.parent_id}
    # as json.dumps with indent=1 writes it, which takes ten times as long
    lines = [f' "{name}": {json.dumps(value)},' for name, value in added.items()]
    return "\n".join(["{", *lines]) + row.text[1:]
