"""One table of job kinds, and one of the states of a job, that everything else reads."""

import re
from pathlib import Path
from typing import Any, get_args

import pytest

from api.job_kinds.job_table import JOB_KINDS
from api.limits import RequestLimits
from api.responses import Job
from api.storage.tables import jobs
from syncplan.studies.job_contract import STATES, UNFINISHED, EndState, JobKindName, JobState
from syncplan.studies.study_table import STUDIES
from tests.tools.serving import ROOT


def test_every_study_is_a_kind_of_job() -> None:
    assert tuple(JOB_KINDS) == tuple(STUDIES) == get_args(JobKindName)


def test_a_state_is_unfinished_or_an_end() -> None:
    assert tuple(STATES) == get_args(JobState)
    assert {*UNFINISHED, *get_args(EndState)} == set(STATES)
    assert not set(UNFINISHED) & set(get_args(EndState))


@pytest.mark.parametrize(("column", "names"), [("kind", JOB_KINDS), ("state", STATES)])
def test_names_fit_their_columns(column: str, names: dict[str, object]) -> None:
    kind: Any = jobs.c[column].type
    assert max(map(len, names)) <= kind.length


def test_the_document_names_the_kinds_and_states_of_the_tables() -> None:
    properties = Job.model_json_schema()["properties"]
    assert properties["kind"]["enum"] == list(JOB_KINDS)
    assert properties["state"]["enum"] == list(STATES)


def test_limits_that_requests_name_are_there() -> None:
    for kind in JOB_KINDS.values():
        assert set(kind.request.limited()) <= set(kind.request.model_fields)
        assert set(kind.request.limited().values()) <= set(RequestLimits.__dataclass_fields__)


def test_no_module_tests_for_a_kind_by_its_name() -> None:
    named = "|".join(JOB_KINDS)
    test = re.compile(rf"""kind\s*[!=]==?\s*["']({named})["']""")
    found = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for folder, kind in (("api", "*.py"), ("api/page", "*.js"), ("syncplan/client", "*.py"))
        for path in Path(ROOT, folder).rglob(kind)
        for line in path.read_text().splitlines()
        if test.search(line)
    ]
    assert found == []
