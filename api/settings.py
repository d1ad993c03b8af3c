"""Settings of the service: one class, read from SYNCPLAN_* variables, checked at the start."""

import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationError, ValidationInfo
from pydantic import field_validator as checked
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError

from api.keys import ApiKey, check_keys, parsed_keys
from syncplan.errors import InputError
from syncplan.phrases import limit_in_words
from syncplan.runtime.machine import usable_cores, usable_memory

# --- addresses of databases -----------------------------------------------------------------------


_POSTGRES = {"postgres", "postgresql", "postgresql+psycopg"}


def checked_address(value: str) -> str:
    """Return the checked address of a database, PostgreSQL's through psycopg 3.

    Raises ValueError if it is not the address of a supported database.
    """
    try:
        url = make_url(value)
    except (ArgumentError, ValueError):
        raise ValueError(_allowed("can't be read as an address")) from None
    if url.drivername in _POSTGRES:
        if not url.database:
            raise ValueError(_allowed("names no database"))
        return url.set(drivername="postgresql+psycopg").render_as_string(hide_password=False)
    if url.drivername != "sqlite":
        raise ValueError(_allowed("is neither SQLite nor PostgreSQL"))
    if url.host or url.query or not url.database or url.database == ":memory:":
        raise ValueError(_allowed("names no file, or more than a file"))
    return sqlite_address(Path(os.path.abspath(os.path.expanduser(url.database))))


def _allowed(problem: str) -> str:
    return f"{problem}; allowed are sqlite:///FILE and postgresql://USER:PASSWORD@HOST:PORT/NAME"


def sqlite_address(path: Path) -> str:
    """Return the address of a SQLite file."""
    return URL.create("sqlite", database=str(path)).render_as_string(hide_password=False)


# --- settings -------------------------------------------------------------------------------------


PREFIX = "SYNCPLAN_"
_SECRET = {"api_keys"}
_VALUE_LENGTH = 100
LEAST_TASK_MEMORY_BYTES = 2**30
_HOST = re.compile(r"[a-z0-9_.-]{1,253}|[0-9a-f:.]{2,45}")

Count = Annotated[int, Field(ge=1)]
Seconds = Annotated[float, Field(gt=0)]


def _absolute(value: Path) -> Path:
    path = os.path.expanduser(value)
    if path.startswith("~"):
        raise ValueError("has no home folder to start from; give an absolute path")
    return Path(os.path.abspath(path))


_TILES = re.compile(r"https?://[A-Za-z0-9.-]+(:[0-9]{1,5})?/[A-Za-z0-9{}/._~?=&%@+-]*")


def _tile_template(value: str) -> str:
    # its origin goes into a header: nothing may end the name of a host
    named = sorted(re.findall(r"\{[^}]*\}?", value))
    if not _TILES.fullmatch(value) or named != ["{x}", "{y}", "{z}"]:
        raise ValueError(
            "must be an address with {z}, {x} and {y}, such as "
            "https://tiles.example.org/{z}/{x}/{y}.png"
        )
    return value


def _listed(text: str) -> tuple[str, ...]:
    return tuple(name.lower() for part in text.split(",") if (name := part.strip()))


_FROM_TEXT = {"api_keys": parsed_keys, "allowed_hosts": _listed, "log_level": str.lower}
"""Functions that read settings from text, by the names of the settings."""

AbsolutePath = Annotated[Path, AfterValidator(_absolute)]


def _sound_keys(value: tuple[ApiKey, ...]) -> tuple[ApiKey, ...]:
    check_keys(value)
    return value


def _beyond_heartbeats(value: float, info: ValidationInfo) -> float:
    beat = info.data.get("heartbeat_s", 0.0)
    if value < 2.0 * beat:
        raise ValueError(f"must be at least two heartbeats of {beat:g} s ({PREFIX}HEARTBEAT_S)")
    return value


class Settings(BaseSettings):
    """Everything an operator can set; each field is the variable SYNCPLAN_ plus its name."""

    model_config = SettingsConfigDict(
        env_prefix=PREFIX,
        env_file=None,
        env_ignore_empty=True,
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )

    host: str = "127.0.0.1"
    """address or name to listen on"""
    port: int = Field(default=8000, ge=0, le=65535)
    """port to listen on; 0 takes a free one"""
    data_dir: AbsolutePath = Field(default_factory=lambda: _data_home() / "syncplan")
    """folder of the embedded database"""
    database_url: Annotated[str, AfterValidator(checked_address)] | None = Field(
        default=None,
        repr=False,
        description="sqlite:///FILE or postgresql://USER:PASSWORD@HOST/NAME; SQLite in the data "
        "folder if not given",
    )
    api_keys: Annotated[tuple[ApiKey, ...], NoDecode, AfterValidator(_sound_keys)] = ()
    """keys that clients may present: NAME:KEY or KEY, separated by commas"""
    api_keys_file: AbsolutePath | None = None
    """file of further keys, NAME:KEY a line; changes take effect within a second"""
    insecure: bool = False
    """listen beyond this machine without a key"""
    allowed_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="names, beside those of this machine, under which a service without keys "
        "answers, and whose pages may ask it; separated by commas",
    )
    tiles: Annotated[str, AfterValidator(_tile_template)] | None = Field(
        default=None,
        description="address of map tiles that the page draws below a formation with a geo_origin, "
        "such as https://tiles.example.org/{z}/{x}/{y}.png; the page's content policy lets it load "
        "images from there; none if not given",
    )
    tiles_attribution: str = ""
    """text that goes with the tiles, as their licence asks for"""
    max_refused_keys: Count = 20
    """most wrong keys that an address may present in a minute"""
    max_connections: Count | None = Field(
        default=None,
        description="most connections; what the file descriptors of a process allow, at most "
        "4096 for each HTTP process, if not given",
    )
    max_connections_per_address: Count | None = None
    """most connections of a client's address (IPv6: of its /64); half of all if not given"""
    head_timeout_s: Seconds = 10.0
    """longest time for the head of a request to arrive, in seconds"""
    body_timeout_s: Seconds = 30.0
    """longest time for the body of a request to arrive, in seconds"""
    answer_timeout_s: Seconds = 30.0
    """longest time in which a client may read nothing of its answer, in seconds"""
    idle_timeout_s: Seconds = 5.0
    """longest time between an answer and the next request of a connection, in seconds"""
    body_limit_bytes: Count = 2**20
    """largest body of a request, in bytes"""
    recording_limit_bytes: Count = 2**26
    """largest archive of a recording, in bytes"""
    max_vehicles: Count = 200
    """most vehicles in a scenario"""
    max_samples: Count = 20_000
    """most samples in a run or a window"""
    max_trials: Count = 100_000
    """most trials of a Monte Carlo"""
    max_run_s: Seconds = 100_000.0
    """longest duration of a run that may be asked for, in seconds"""
    max_refine_s: Seconds = 600.0
    """longest search of a refinement, in seconds"""
    max_sweep_values: Count = 50
    """most values in a sweep"""
    max_design_evaluations: Count = 250_000
    """most candidates that a design looks at, of all teams together"""
    max_sightings: Count = 5_000_000
    """most sightings in a run, as expected from circles and ranges"""
    plan_timeout_s: Seconds = 20.0
    """longest time from a request's body to its answer, in seconds"""
    max_queued_jobs: Count = 20
    """most unfinished jobs of one owner"""
    max_plan_queue: Count = 256
    """most requests waiting for a process, of all owners together"""
    max_requests: Count = 64
    """most requests of one owner that wait for a process or are computed"""
    max_streams: Count = 100
    """most event streams that one owner may have open"""
    processes: Count | None = None
    """child processes that compute; one for each usable core if not given"""
    task_memory_bytes: Annotated[int, Field(ge=2**29)] | None = Field(
        default=None,
        description="most memory of a child process, in bytes; what the machine or container has, "
        "divided by the processes, and at least 1 GiB, if not given",
    )
    http_processes: Count = Field(
        default=1,
        description="processes that answer requests on one socket; child processes and limits of "
        "the whole service are divided among them",
    )
    job_niceness: Annotated[int, Field(ge=0, le=19)] = 10
    """niceness of processes of jobs, by which they yield to those of requests, 0 to 19"""
    keep_jobs_s: Seconds = 7 * 86400.0
    """how long ended jobs are kept, in seconds"""
    keep_plans_s: Seconds | None = None
    """how long plans are kept, in seconds; for ever if not given"""
    max_plans: Count = 20_000
    """most stored plans of one owner before no more can be posted"""
    keep_recordings_s: Seconds = 7 * 86400.0
    """how long recordings are kept, in seconds"""
    max_recordings: Count = 20
    """most stored recordings of one owner before no more can be posted"""
    max_owner_bytes: Count = 2**31
    """most bytes of one owner's plans, jobs, answers and recordings before no more are taken"""
    keep_answers_s: Seconds = 86400.0
    """how long an answer is kept under its Idempotency-Key, in seconds"""
    heartbeat_s: Seconds = 2.0
    """time between a worker's heartbeats, in seconds"""
    dead_after_s: Annotated[Seconds, AfterValidator(_beyond_heartbeats)] = 8.0
    """silence after which a worker counts as dead, in seconds"""
    batch_s: Seconds = 7.0
    """target computing time of a batch, in seconds"""
    job_task_s: Seconds = 3600.0
    """longest time to compute a part of a job, in seconds"""
    max_job_seconds: Seconds = 30 * 86400.0
    """most computing time of one owner's jobs in 24 hours, in seconds"""
    version_grace_s: Seconds = 600.0
    """how long jobs wait for a worker of the version that began them, in seconds"""
    embedded_worker: bool = True
    """let the server run jobs as well"""
    worker_host: str = "127.0.0.1"
    """address or name at which a worker listens, if it has a port"""
    worker_port: int | None = Field(default=None, ge=0, le=65535)
    """port at which a worker answers /healthz, /readyz and /metrics; none if not given"""
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    """lowest severity that is logged"""
    telemetry: bool = False
    """export traces and metrics by OpenTelemetry"""

    @property
    def database(self) -> str:
        """Address of the database for SQLAlchemy; PostgreSQL through psycopg 3."""
        if self.database_url is not None:
            return self.database_url
        return sqlite_address(self.data_dir / "syncplan.db")

    @property
    def asks_for_keys(self) -> bool:
        """Whether requests need a key."""
        return bool(self.api_keys) or self.api_keys_file is not None

    @property
    def process_count(self) -> int:
        """Number of child processes that compute."""
        return usable_cores() if self.processes is None else self.processes

    @property
    def task_memory(self) -> int:
        """Bytes of memory that a child process may use."""
        if self.task_memory_bytes is not None:
            return self.task_memory_bytes
        return max((usable_memory() or 0) // self.process_count, LEAST_TASK_MEMORY_BYTES)

    @checked(*_FROM_TEXT, mode="before")
    @classmethod
    def _from_text(cls, value: Any, info: ValidationInfo) -> Any:
        return _FROM_TEXT[str(info.field_name)](value) if isinstance(value, str) else value

    @checked("allowed_hosts")
    @classmethod
    def _bare_hosts(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for name in value:
            if not _HOST.fullmatch(name):
                raise ValueError(
                    f"{name!r} must be a name or an address alone, such as plans.example"
                )
        return value


def load_settings(**overrides: Any) -> Settings:
    """Return the settings of the environment; `overrides` that are not None take precedence.

    Raises InputError naming the variable (or the override), its value unless it is secret, and
    what is allowed.
    """
    given = {name: value for name, value in overrides.items() if value is not None}
    try:
        return Settings(**given)
    except ValidationError as error:
        faults = [
            (_label(str(item["loc"][0]), given), _shown(str(item["loc"][0]), dict(item)))
            for item in error.errors(include_url=False)
        ]
    (key, problem), rest = faults[0], faults[1:]
    shown = [problem, *(f"{name}: {text}" for name, text in rest)]
    raise InputError("; ".join(shown), key=key)


def _label(name: str, given: dict[str, Any]) -> str:
    return name if name in given else PREFIX + name.upper()


def _shown(name: str, fault: dict[str, Any]) -> str:
    if fault["type"] == "extra_forbidden":
        return "is no setting"
    message = limit_in_words(str(fault["msg"])).removeprefix("Value error, ")
    message = message.replace("Input should", "must")
    if name in _SECRET:
        return message
    value = str(fault["input"])
    if name == "database_url":
        value = re.sub(r"(?<=//).*@|^[^/]*@", "***@", value).partition("?")[0]
    if len(value) > _VALUE_LENGTH:
        value = value[: _VALUE_LENGTH - 3] + "..."
    return f"{value!r}: {message}"


def _data_home() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or "~/AppData/Local")
    given = os.environ.get("XDG_DATA_HOME", "")
    return Path(given if os.path.isabs(given) else "~/.local/share")


# --- parts of several HTTP processes -------------------------------------------------------------


_DIVIDED = (
    "max_connections",
    "max_connections_per_address",
    "max_plan_queue",
    "max_refused_keys",
    "max_requests",
    "max_streams",
)
"""Limits of the whole service that are divided among its processes."""


@dataclass(frozen=True, slots=True)
class Share:
    """Number of this process, from 0, and the count of processes."""

    number: int = 0
    count: int = 1

    def of(self, total: int) -> int:
        """Return this process's part of a total; parts add up to it, but each is at least 1."""
        return max(1, (total + self.count - 1 - self.number) // self.count)


ALONE = Share()
"""Share of a service with one HTTP process."""


def divided(settings: Settings, share: Share) -> Settings:
    """Return the settings of one of several processes; only the first keeps the worker."""
    update: dict[str, Any] = {
        name: share.of(total) for name in _DIVIDED if (total := getattr(settings, name)) is not None
    }
    if share.number > 0:
        update["embedded_worker"] = False
    return settings.model_copy(update=update)
