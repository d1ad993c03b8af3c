"""The recording of real robots, for the tests that need it."""

import tarfile

import pytest

from syncplan.recordings.log import Log
from syncplan.recordings.recording_formats import load_log
from tests.tools.recordings import REAL


@pytest.fixture(scope="session")
def real(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """The recording of five robots among fifteen landmarks, over 772 s."""
    if not REAL.exists():
        pytest.skip(f"needs the recording {REAL.name} beside the checkout")
    folder = tmp_path_factory.mktemp("real")
    with tarfile.open(REAL) as archive:
        archive.extractall(folder, filter="data")
    return load_log(next(folder.rglob("Barcodes.dat")).parent)
