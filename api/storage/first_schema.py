"""The tables as schema version 1 had them: a copy of them, frozen on purpose.

Every database begins with these, and `api.storage.migrations` brings it forward from here. Tables
shared with `api.storage.tables` would change with those of today, and a new database would then
differ from one that was upgraded.
"""

from sqlalchemy import (
    Boolean,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
)

FIRST_METADATA = MetaData()


def _job_id() -> "Column[str]":
    return Column("job_id", String(36), ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)


Table(
    "syncplan_schema",
    FIRST_METADATA,
    Column("version", Integer, primary_key=True, autoincrement=False),
)
Table(
    "plans",
    FIRST_METADATA,
    Column("id", String(36), primary_key=True),
    Column("owner", String(80), nullable=False),
    Column("parent_id", String(36)),
    Column("created_at", String(27), nullable=False),
    Column("name", Text),
    Column("vehicles", Integer, nullable=False),
    Column("observable", Boolean, nullable=False),
    Column("predicted_rms_m", Float),
    Column("etag", String(64), nullable=False),
    Column("text", Text, nullable=False),
    Index("plans_of_owner", "owner", "id"),
)
Table(
    "jobs",
    FIRST_METADATA,
    Column("id", String(36), primary_key=True),
    Column("owner", String(80), nullable=False),
    Column("kind", String(16), nullable=False),
    Column("state", String(16), nullable=False),
    Column("request", Text, nullable=False),
    Column("plan_id", String(36)),
    Column("plan_text", Text),
    Column("done", Integer, nullable=False),
    Column("total", Integer, nullable=False),
    Column("created_at", String(27), nullable=False),
    Column("started_at", String(27)),
    Column("ended_at", String(27)),
    Column("result_plan_id", String(36)),
    Column("error", Text),
    Column("events", Integer, nullable=False),
    Index("jobs_of_owner", "owner", "id"),
    Index("jobs_by_state", "state", "ended_at"),
)
Table(
    "job_results",
    FIRST_METADATA,
    _job_id(),
    Column("text", Text, nullable=False),
    Column("trials", LargeBinary),
)
Table(
    "job_parts",
    FIRST_METADATA,
    _job_id(),
    Column("number", Integer, primary_key=True),
    Column("run", Integer, nullable=False),
    Column("first_trial", Integer, nullable=False),
    Column("trials", Integer, nullable=False),
    Column("done", Integer, nullable=False),
    Column("data", LargeBinary),
)
Table(
    "job_events",
    FIRST_METADATA,
    _job_id(),
    Column("number", Integer, primary_key=True),
    Column("data", Text, nullable=False),
)
Table(
    "answers",
    FIRST_METADATA,
    Column("owner", String(80), primary_key=True),
    Column("key", String(255), primary_key=True),
    Column("request_digest", String(64), nullable=False),
    Column("status", Integer, nullable=False),
    Column("headers", Text, nullable=False),
    Column("body", Text, nullable=False),
    Column("created_at", String(27), nullable=False),
    Index("answers_by_age", "created_at"),
)
Table(
    "executors",
    FIRST_METADATA,
    Column("id", String(64), primary_key=True),
    Column("beats", Integer, nullable=False),
)
