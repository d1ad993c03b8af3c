"""What several tests of the command line begin with."""

from pathlib import Path
from typing import Any

import pytest

from tests.tools.scenarios import FILES


@pytest.fixture
def plan_file(run: Any, tmp_path: Path) -> Path:
    """The plan of paper-grid-same as the command line writes it."""
    path = tmp_path / "plan.json"
    assert run("plan", str(FILES / "paper-grid-same.yaml"), "-o", str(path))[0] == 0
    return path
