"""The tables, as of the newest schema version; times are RFC 3339 in UTC, identifiers ordered."""

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

METADATA = MetaData()

schema_version = Table(
    "syncplan_schema",
    METADATA,
    Column("version", Integer, primary_key=True, autoincrement=False),
    # the oldest version whose processes can work on this one
    Column("usable_from", Integer),
)

plans = Table(
    "plans",
    METADATA,
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

jobs = Table(
    "jobs",
    METADATA,
    Column("id", String(36), primary_key=True),
    Column("owner", String(80), nullable=False),
    Column("kind", String(16), nullable=False),
    Column("state", String(16), nullable=False),
    Column("request", Text, nullable=False),
    Column("plan_id", String(36)),
    # a copy, so that deleting the plan does not break the job
    Column("plan_text", Text),
    Column("done", Integer, nullable=False),
    Column("total", Integer, nullable=False),
    Column("created_at", String(27), nullable=False),
    Column("started_at", String(27)),
    Column("ended_at", String(27)),
    Column("result_plan_id", String(36)),
    Column("error", Text),
    Column("events", Integer, nullable=False),
    # of the syncplan that works on it: empty until one does, None of one from before version 2
    Column("version", String(40)),
    # how often it was begun anew
    Column("begun", Integer, nullable=False, server_default="0"),
    # by the children that worked on it, over all attempts
    Column("computed_s", Float, nullable=False, server_default="0"),
    # the trace of the request, as W3C Trace Context writes it
    Column("traceparent", String(55)),
    # of a replay
    Column("recording_id", String(36)),
    Index("jobs_of_owner", "owner", "id"),
    Index("jobs_by_state", "state", "ended_at"),
)


recordings = Table(
    "recordings",
    METADATA,
    Column("id", String(36), primary_key=True),
    Column("owner", String(80), nullable=False),
    Column("created_at", String(27), nullable=False),
    Column("size", Integer, nullable=False),
    # in short, as JSON
    Column("overview", Text, nullable=False),
    # as syncplan.recordings.log packs it
    Column("data", LargeBinary, nullable=False),
    Index("recordings_of_owner", "owner", "id"),
)


def _job_id() -> "Column[str]":
    return Column("job_id", String(36), ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)


job_results = Table(
    "job_results",
    METADATA,
    _job_id(),
    Column("text", Text, nullable=False),
    # of a validation or flight: the figures of each trial, packed as its kind does
    Column("trials", LargeBinary),
)

job_parts = Table(
    "job_parts",
    METADATA,
    _job_id(),
    Column("number", Integer, primary_key=True),
    Column("run", Integer, nullable=False),
    Column("first_trial", Integer, nullable=False),
    Column("trials", Integer, nullable=False),
    Column("done", Integer, nullable=False),
    Column("data", LargeBinary),
    # how often it was begun, and how often its child was killed
    Column("attempts", Integer, nullable=False, server_default="0"),
    Column("deaths", Integer, nullable=False, server_default="0"),
    # over all attempts
    Column("computed_s", Float, nullable=False, server_default="0"),
)

# finished starts of a refinement, of which a killed one goes on
job_starts = Table(
    "job_starts",
    METADATA,
    _job_id(),
    Column("number", Integer, primary_key=True),
    Column("data", LargeBinary, nullable=False),
)

job_events = Table(
    "job_events",
    METADATA,
    _job_id(),
    Column("number", Integer, primary_key=True),
    Column("data", Text, nullable=False),
)

answers = Table(
    "answers",
    METADATA,
    Column("owner", String(80), primary_key=True),
    Column("key", String(255), primary_key=True),
    Column("request_digest", String(64), nullable=False),
    Column("status", Integer, nullable=False),
    Column("headers", Text, nullable=False),
    Column("body", Text, nullable=False),
    Column("created_at", String(27), nullable=False),
    Index("answers_by_age", "created_at"),
)

executors = Table(
    "executors",
    METADATA,
    Column("id", String(64), primary_key=True),
    Column("beats", Integer, nullable=False),
    # of its syncplan; None for one from before schema version 2
    Column("version", String(40)),
    # its last heartbeat, by the database's clock
    Column("seen_at", String(27)),
)

# when a worker of a version was last alive, by the database's clock
versions = Table(
    "versions",
    METADATA,
    Column("version", String(40), primary_key=True),
    Column("seen_at", String(27), nullable=False),
)
