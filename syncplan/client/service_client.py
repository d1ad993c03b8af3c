"""A client of the service: the library's functions in the same few lines, computed remotely.

    client = syncplan.Client("http://127.0.0.1:8000")
    plan = client.plan(syncplan.load_scenario("scenario.yaml"))
    better = client.wait(client.refine(plan))
    report = client.wait(client.validate(better, trials=500, seed=1))

Every POST carries an Idempotency-Key, so that a request whose answer was lost can be repeated
without doing anything twice.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self
from urllib.parse import quote

from syncplan.client.connection import Remote, RemoteError, error_of, values_of
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions, options_with
from syncplan.guidance.flight_options import FlightOptions
from syncplan.importing.import_options import ImportOptions
from syncplan.importing.imported_places import ImportedPlaces
from syncplan.options import lists_options
from syncplan.planning.loss_study import WhatIfDocument
from syncplan.planning.plan_files import PlanSubject, loaded_from, loaded_of, plan_of, stated
from syncplan.planning.planner import BoundChoice
from syncplan.planning.plans import Plan
from syncplan.recordings.recording_formats import Stamps, archived
from syncplan.reports.sites_report import SitesDocument
from syncplan.scenario.brief import Brief, brief_of
from syncplan.scenario.loading import read_bytes, scenario_of
from syncplan.scenario.specification import Scenario
from syncplan.studies.job_contract import JobKindName, JobState, has_ended
from syncplan.studies.study import STORED, TrialStudy
from syncplan.studies.study_table import STUDIES

# --- items stored by the service ------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class RemotePlan(Plan):
    """A plan that the service stores, judged by this library from its orbits.

    Attributes
    ----------
    id, parent_id : identifiers of the plan and of the one it was refined from
    created_at : time of creation, RFC 3339 in UTC
    document : the service's document, see syncplan.reports.plan_report.PlanDocument
    """

    id: str
    parent_id: str | None
    created_at: str
    document: Mapping[str, Any] = field(repr=False, compare=False)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """Return the content of one of the service's documents."""
        made = plan_of(loaded_from(document, max_vehicles=len(document["vehicles"])))
        values = {one.name: getattr(made, one.name) for one in fields(made) if one.init}
        return cls(
            **values,
            id=document["id"],
            parent_id=document["parent_id"],
            created_at=document["created_at"],
            document=document,
        )


@dataclass(frozen=True, slots=True)
class RemotePlanSummary:
    """A plan that the service stores, in short.

    Attributes
    ----------
    parent_id : identifier of the plan it was refined from
    created_at : time of creation, RFC 3339 in UTC
    go : whether the verdict is GO; None for a plan of an early version, which has none
    predicted_rms_m : RMS over all vehicles; None if no error is predicted
    worst_predicted_rms_m : of the worst vehicle; None if unknown, and from an earlier service
    outline : `circles`, `landmarks` and `area` in m of a small map; None as above
    """

    id: str
    parent_id: str | None
    created_at: str
    name: str | None
    vehicles: int
    observable: bool
    go: bool | None
    predicted_rms_m: float | None
    worst_predicted_rms_m: float | None = None
    outline: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """Return the content of a row of the service's list."""
        known = {entry.name for entry in fields(cls)} & document.keys()
        return cls(**{name: document[name] for name in known})


@dataclass(frozen=True, slots=True)
class RemoteUsage:
    """What the owner of a key uses of the service, and the most allowed.

    Attributes
    ----------
    bytes : bytes kept, by kind: plans, jobs, answers, recordings
    max_bytes : most bytes of all kinds together
    computing_s : computing time of the jobs of the last 24 hours
    max_job_seconds : computing time in 24 hours after which no more jobs are taken
    """

    bytes: Mapping[str, int]
    max_bytes: int
    computing_s: float
    max_job_seconds: float


@dataclass(frozen=True, slots=True)
class RemoteJob:
    """A job of the service in the state last requested.

    Attributes
    ----------
    done, total : progress in trials; in starts for a refinement, in sightings for a replay
    document : the service's document
    plan : plan of the job, if the client was given it
    """

    id: str
    kind: JobKindName
    state: JobState
    done: int
    total: int
    document: Mapping[str, Any] = field(repr=False, compare=False)
    plan: RemotePlan | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """Return the content of one of the service's documents."""
        progress = document["progress"]
        return cls(
            id=document["id"],
            kind=document["kind"],
            state=document["state"],
            done=progress["done"],
            total=progress["total"],
            document=document,
        )

    @property
    def ended(self) -> bool:
        """Whether the job has ended."""
        return has_ended(self.state)


@dataclass(frozen=True, slots=True)
class RemoteRecording:
    """A recording that the service stores.

    Attributes
    ----------
    robots, landmarks : names; numbers where the files number landmarks
    document : the service's document
    """

    id: str
    name: str
    robots: tuple[str, ...]
    landmarks: tuple[int | str, ...]
    document: Mapping[str, Any] = field(repr=False, compare=False)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Self:
        """Return the content of one of the service's documents."""
        return cls(
            id=document["id"],
            name=document["name"],
            robots=tuple(document["robots"]),
            landmarks=tuple(document["landmarks"]),
            document=document,
        )


_LOOK_AT_FIRST_S, _LOOK_AT_LAST_S = 0.1, 1.0


class Client:
    """A connection to a service.

    Parameters
    ----------
    url : address of the service, such as http://127.0.0.1:8000
    api_key : API key, if the service requires one
    timeout_s : time limit of one request
    patience_s : time for which requests are repeated while the service is unavailable or busy
    """

    def __init__(
        self,
        url: str,
        api_key: str | None = None,
        *,
        timeout_s: float = 60.0,
        patience_s: float = 60.0,
    ) -> None:
        self._remote = Remote(url, api_key, timeout_s, patience_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._remote.close()

    def usage(self) -> RemoteUsage:
        """Return the bytes that the service keeps and the computing time, with their limits."""
        return RemoteUsage(**values_of(self._remote.send("GET", "/v1/usage"), "max_bytes"))

    # --- plans ---

    def plan(
        self,
        subject: PlanSubject,
        *,
        steady: bool = False,
        pilot: bool = True,
    ) -> RemotePlan:
        """Return the plan of a scenario, stored by the service; see syncplan.plan.

        A plan, or the file or mapping of a plan, keeps its orbits, which are judged again.
        Raises InputError.
        """
        body = _as_planned(subject)
        chosen = {"steady": steady, "paper": not pilot}
        parameters = {name: "true" for name, value in chosen.items() if value}
        return RemotePlan.of(values_of(self._remote.send("POST", "/v1/plans", body, parameters)))

    def stored(self, plan_id: str) -> RemotePlan:
        """Return a plan that the service stores."""
        return RemotePlan.of(values_of(self._remote.send("GET", f"/v1/plans/{_id(plan_id)}")))

    def plans(self) -> Iterator[RemotePlanSummary]:
        """Yield the plans that the service stores, newest first."""
        return map(RemotePlanSummary.of, self._listed("/v1/plans"))

    def rename(self, plan: RemotePlan | str, name: str) -> RemotePlan:
        """Give a plan that the service stores another name, and return it. Raises InputError."""
        answer = self._remote.send("PATCH", f"/v1/plans/{_id(plan)}", {"name": name})
        return RemotePlan.of(values_of(answer))

    def delete(self, plan: RemotePlan | str) -> None:
        """Delete a plan that the service stores."""
        self._remote.send("DELETE", f"/v1/plans/{_id(plan)}")

    def what_if(
        self,
        plan: RemotePlan | str,
        lose: Sequence[str] = (),
        *,
        losses: Literal[1, 2] = 1,
        bound: BoundChoice = "auto",
    ) -> WhatIfDocument:
        """Return the effects of losses on a plan that the service stores; see syncplan.what_if."""
        parameters = {"lose": list(lose), "losses": str(losses), "bound": bound}
        answer = self._remote.send("GET", f"/v1/plans/{_id(plan)}/what-if", None, parameters)
        return WhatIfDocument.model_validate(values_of(answer, "losses"))

    def choose_landmarks(
        self, plan: RemotePlan | str, candidates: Sequence[str], choose: int, *, seed: int = 0
    ) -> SitesDocument:
        """Return the best of some landmarks of a stored plan; see syncplan.choose_landmarks."""
        parameters = {"candidate": list(candidates), "choose": str(choose), "seed": str(seed)}
        answer = self._remote.send(
            "GET", f"/v1/plans/{_id(plan)}/landmark-choice", None, parameters
        )
        return SitesDocument.model_validate(values_of(answer, "chosen"))

    @lists_options(ImportOptions)
    def import_places(self, file: str | Path, **options: Any) -> ImportedPlaces:
        """Return the features of a file and what they become; see syncplan.import_places.

        Raises InputError.
        """
        name, data = read_bytes(file)
        parameters = {"file": Path(name).name, **ImportOptions(**options).as_request()}
        answer = self._remote.send("POST", "/v1/imports", data, parameters)
        return ImportedPlaces.model_validate(values_of(answer, "features"))

    # --- recordings ---

    def upload(
        self, recording: str | Path, *, name: str | None = None, stamps: Stamps = "header"
    ) -> RemoteRecording:
        """Upload a folder, bag or archive; return the recording, which the service keeps a while.

        Without a name, it has that of its folder; `stamps` is as in load_log. Raises InputError.
        """
        parameters = {"stamps": stamps} | ({} if name is None else {"name": name})
        body = archived(Path(recording))
        answer = self._remote.send("POST", "/v1/recordings", body, parameters)
        return RemoteRecording.of(values_of(answer, "robots"))

    def recordings(self) -> Iterator[RemoteRecording]:
        """Yield the recordings that the service stores, newest first."""
        return map(RemoteRecording.of, self._listed("/v1/recordings"))

    def rename_recording(self, recording: RemoteRecording | str, name: str) -> RemoteRecording:
        """Give a recording another name for further reports, and return it. Raises InputError."""
        path = f"/v1/recordings/{_id(recording)}"
        return RemoteRecording.of(values_of(self._remote.send("PATCH", path, {"name": name})))

    def forget(self, recording: RemoteRecording | str) -> None:
        """Delete a recording that the service stores; raises RemoteError while a job needs it."""
        self._remote.send("DELETE", f"/v1/recordings/{_id(recording)}")

    # --- jobs ---

    def start(
        self, study: str, subject: "RemotePlan | RemoteRecording | str" = "", **request: Any
    ) -> RemoteJob:
        """Start a study, by its name in syncplan.studies.study_table. See wait.

        `subject` is the plan or the recording that it is about; other keywords are the keys of the
        service's request, such as duration_s. Raises InputError.
        """
        if study not in STUDIES:
            raise InputError(f"{study!r} is unknown; choose from {', '.join(STUDIES)}", key="study")
        of, path = STUDIES[study].of, STUDIES[study].path
        if bool(subject) != (of in STORED):
            what = f"give the {of} that it is about" if of in STORED else f"a {study} has none"
            raise InputError(what, key="subject")
        named = path.format(plan_id=_id(subject), recording_id=_id(subject))
        job = self._job("POST", f"/v1{named}", request)
        return replace(job, plan=subject) if isinstance(subject, RemotePlan) else job

    def refine(self, plan: RemotePlan | str, **options: Any) -> RemoteJob:
        """Start the refinement of a plan; options as in syncplan.refine. See wait."""
        return self.start("refinement", plan, **options)

    @lists_options(FilterOptions)
    def validate(
        self,
        plan: RemotePlan | str,
        options: FilterOptions | None = None,
        *,
        stress: bool = False,
        **changes: Any,
    ) -> RemoteJob:
        """Start the validation of a plan; options as in syncplan.validate. See wait.

        With `stress`, the job's report also has worse worlds; `wait` returns the validation in the
        world as stated.
        """
        further = {"stress": True} if stress else {}
        request = options_with(options, changes).as_request()
        return self.start("validation", plan, **request, **further)

    @lists_options(FlightOptions)
    def fly(
        self,
        plan: RemotePlan | str,
        options: FlightOptions | None = None,
        **changes: Any,
    ) -> RemoteJob:
        """Start flights of a plan; options as in syncplan.fly. See wait."""
        return self.start(
            "flight", plan, **replace(options or FlightOptions(), **changes).as_request()
        )

    def sweep(
        self, scenario: Scenario | str | Path | Mapping[str, Any], **options: Any
    ) -> RemoteJob:
        """Start a sweep; options are the keys of the service's request, such as range_m."""
        return self.start("sweep", scenario=_as_document(scenario), **options)

    def replay(self, recording: RemoteRecording | str, **options: Any) -> RemoteJob:
        """Start a replay; options are the keys of the service's request, such as delay_s."""
        return self.start("replay", recording, **options)

    def design(self, brief: Brief | Mapping[str, Any]) -> RemoteJob:
        """Start a design; see syncplan.design and wait. Raises InputError."""
        return self.start("design", **brief_of(brief).model_dump(mode="json", exclude_none=True))

    def job(self, job_id: str) -> RemoteJob:
        """Return the current state of a job."""
        return self._job("GET", f"/v1/jobs/{_id(job_id)}")

    def jobs(self, state: JobState | None = None) -> Iterator[RemoteJob]:
        """Yield the jobs that the service stores, newest first; only those in a state if given."""
        query = "" if state is None else f"?state={state}"
        return map(RemoteJob.of, self._listed(f"/v1/jobs{query}"))

    def delete_job(self, job: RemoteJob | str) -> None:
        """Delete a job with its report; raises RemoteError if it has not ended."""
        self._remote.send("DELETE", f"/v1/jobs/{_id(job)}")

    def cancel(self, job: RemoteJob | str) -> RemoteJob:
        """Stop a job; raises RemoteError if it has ended otherwise."""
        return self._job("POST", f"/v1/jobs/{_id(job)}/cancel")

    def finish(self, job: RemoteJob | str) -> RemoteJob:
        """Ask a refinement or a design to end soon, with the best found so far. See wait.

        Raises RemoteError if it has ended, or is a job of another kind.
        """
        return self._job("POST", f"/v1/jobs/{_id(job)}/finish")

    def _listed(self, path: str | None) -> Iterator[dict[str, Any]]:
        """Yield the entries of a list from a page on."""
        while path is not None:
            page = values_of(self._remote.send("GET", path), "items")
            yield from page["items"]
            path = page["next"]

    def _job(self, method: str, path: str, body: Mapping[str, Any] | None = None) -> RemoteJob:
        """Return the job in the service's answer to a request."""
        return RemoteJob.of(values_of(self._remote.send(method, path, body)))

    def wait(
        self,
        job: RemoteJob | str,
        progress: Callable[[RemoteJob], None] | None = None,
        *,
        timeout_s: float | None = None,
    ) -> Any:
        """Wait for the end of a job and return its result.

        A RemotePlan for a refinement, a Validation for a validation, a Flight for a flight, and the
        document of any other study, such as the ReplayDocument of a replay. `progress` is called
        with the job whenever it changes. Raises InputError or NoSolutionError if the job failed for
        such a reason, RemoteError if it was cancelled, failed otherwise or is not done in time.
        """
        began, pause, shown = time.monotonic(), _LOOK_AT_FIRST_S, None
        while True:
            now = self.job(_id(job))
            if progress is not None and now != shown:
                progress(now)
                shown = now
            if now.ended:
                return self._result(now, job.plan if isinstance(job, RemoteJob) else None)
            if timeout_s is not None and time.monotonic() - began + pause > timeout_s:
                late = f"job {now.id} is {now.state} after {timeout_s:g} s; it continues"
                raise RemoteError(late)
            time.sleep(pause)
            pause = min(1.5 * pause, _LOOK_AT_LAST_S)

    def _result(self, job: RemoteJob, plan: RemotePlan | None) -> Any:
        if job.state == "failed":
            failure = job.document["error"]
            raise error_of(failure, f"job {job.id} failed: {failure['detail']}", None)
        if job.state == "cancelled":
            raise RemoteError(f"job {job.id} was cancelled")
        study = STUDIES.get(job.kind)
        if isinstance(study, TrialStudy) and study.keeps_trials:
            plan = self.stored(job.document["plan_id"]) if plan is None else plan
            run = study.first_run(plan, study.options.of_request(job.document["request"]))
            return run.concluded([run.unpack(self._trials(job))])
        answer = self._remote.send("GET", f"/v1/jobs/{job.id}/result")
        if study is None:
            # of a later version of the service
            return values_of(answer, None)
        if study.document is None:
            return RemotePlan.of(values_of(answer))
        try:
            return study.document.model.model_validate(values_of(answer, None))
        except ValueError as error:
            raise RemoteError(f"{answer.url.path}: the answer is no {study.name}") from error

    def _trials(self, job: RemoteJob) -> bytes:
        """Packed figures of each trial of a job."""
        path = f"/v1/jobs/{job.id}/trials"
        return self._remote.send("GET", path, accept="application/octet-stream").content


def _as_planned(subject: PlanSubject) -> dict[str, Any]:
    """Body of a request for a plan: the document of a scenario, or of a plan."""
    loaded = subject if isinstance(subject, Plan) else loaded_of(subject)
    if loaded.orbits is None:
        return _as_document(loaded.scenario)
    return stated(loaded.scenario, loaded.orbits)


def _as_document(scenario: Scenario | str | Path | Mapping[str, Any]) -> dict[str, Any]:
    return scenario_of(scenario).model_dump(mode="json", exclude_none=True)


def _id(item: RemotePlan | RemoteJob | RemoteRecording | str) -> str:
    if isinstance(item, str):
        return quote(item, safe="")
    if not isinstance(item, RemotePlan | RemoteJob | RemoteRecording):
        raise InputError(
            f"a {type(item).__name__} is not known to the service; give what its plan(), refine() "
            "or validate() returned, or an identifier",
            key="plan",
        )
    return item.id
