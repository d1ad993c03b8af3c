"""A validation and its report, which figures are drawn of."""

import pytest

from syncplan.planning.validation import Validation, validate
from syncplan.reports.validation_report import ValidationDocument, validation_document
from tests.tools.scenarios import example


@pytest.fixture(scope="package")
def run_with_series() -> Validation:
    return validate(example("paper-grid-same"), trials=20, seed=1, duration=100.0, with_series=True)


@pytest.fixture(scope="package")
def report(run_with_series: Validation) -> ValidationDocument:
    return validation_document(run_with_series)
