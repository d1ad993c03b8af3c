"""The recording of real robots, for the tests that need it."""

import pytest

from syncplan.recordings.log import Log
from syncplan.recordings.recording_formats import load_log
from tests.tools.recordings import REAL


@pytest.fixture(scope="session")
def real() -> Log:
    """The recording of five robots among fifteen landmarks, over 772 s."""
    if not REAL.exists():
        pytest.skip(f"needs the recording {REAL.name} beside the checkout")
    return load_log(REAL)
