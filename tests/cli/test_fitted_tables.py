"""Tables in narrow terminals: whole columns go, in the order declared, and no number is cut."""

import io
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from syncplan.cli.fitted_tables import FittedTable
from syncplan.results.quantities import Quantity
from syncplan.results.stories import Grid
from tests.tools.scenarios import FILES, circling

GRID = str(FILES / "paper-grid-same.yaml")


def printed(table: FittedTable, width: int) -> list[str]:
    """The lines of a table in a terminal of that width."""
    console = Console(file=io.StringIO(), width=width, highlight=False)
    console.print(table)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def body(lines: list[str]) -> list[list[str]]:
    """The words of the rows of a table."""
    rule = next(k for k, line in enumerate(lines) if "─" in line)
    rows = (line.split() for line in lines[rule + 1 :])
    return [row for row in rows if row and row[0][0] == "v"]


NUMBERS = st.floats(-1e6, 1e6).map(lambda value: f"{value:.6g}")
ROWS = st.integers(2, 7).flatmap(
    lambda count: st.lists(st.lists(NUMBERS, min_size=count, max_size=count), min_size=1)
)


@given(ROWS, st.integers(40, 100), st.randoms(use_true_random=False))
def test_what_is_shown_is_shown_whole_and_fits(
    rows: list[list[str]], width: int, random: Any
) -> None:
    heads = [f"c{k}" for k in range(len(rows[0]))]
    goes = random.sample(heads, random.randint(0, len(heads)))
    drops = [goes.index(head) + 1 if head in goes else 0 for head in heads]
    columns = [Quantity("v"), *map(lambda head, drop: Quantity(head, drop=drop), heads, drops)]
    named = [(f"v{k}", *cells) for k, cells in enumerate(rows)]
    table = FittedTable(Grid("t", columns, named))
    lines = printed(table, width)
    shown = table.shown_columns(width)
    assert max(map(len, lines)) <= width
    assert body(lines) == [
        [f"v{k}", *(cells[j - 1] for j in shown if j)] for k, cells in enumerate(rows)
    ]
    left = [one.head for k, (one, _) in enumerate(table.columns) if k not in shown]
    order = [*goes, *(head for head in reversed(heads) if head not in goes)]
    assert set(left) == set(order[: len(left)])
    assert any(line.startswith("not shown at this width") for line in lines) == bool(left)
    if left:
        # one column fewer left out would not have fitted
        kept = [k for k, one in enumerate(columns) if one.head not in order[: len(left) - 1]]
        wider = Grid("t", [columns[k] for k in kept], [[row[k] for k in kept] for row in named])
        assert len(FittedTable(wider).shown_columns(width)) < len(kept)


def test_a_long_name_is_folded_and_numbers_stay() -> None:
    name = "a-very-long-name-of-a-vehicle-that-nobody-types"
    table = Grid("t", ("vehicle", Quantity("x", drop=1), "y"), [(name, "1234.5", "6789.25")])
    lines = printed(FittedTable(table), 30)
    assert max(map(len, lines)) <= 30
    assert any("6789.25" in line for line in lines)
    assert "".join(line.split()[0] for line in lines[4:7]).startswith("a-very-long-name")


@pytest.mark.parametrize("width", [80, 60, 40])
@pytest.mark.parametrize(
    "command",
    [("plan", GRID), ("validate", GRID, "--trials", "2", "--duration", "4")],
    ids=lambda command: command[0],
)
def test_commands_cut_no_number(
    run: Any, monkeypatch: pytest.MonkeyPatch, width: int, command: tuple[str, ...]
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    whole = run(*command, "--format", "table")[1]
    monkeypatch.setenv("COLUMNS", str(width))
    narrow = run(*command, "--format", "table")[1]
    assert max(map(len, narrow.splitlines())) <= width
    assert "…" not in narrow
    known = set(whole.split())
    rows = [line for line in narrow.splitlines() if line.startswith((" v", " overall"))]
    assert len(rows) > 6
    for row in rows[1:]:
        assert set(row.split()) <= known | {"vehicle", "link"}


def test_a_plan_shows_speeds_and_a_pipe_takes_all_columns(
    run: Any, written: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    orbit = circling(radius_m=[20.0, 15.0])
    scenario = written(orbit=orbit)
    out = run("plan", scenario, "--format", "table")[1]
    head = next(line for line in out.splitlines() if line.startswith(" vehicle"))
    at = slice(head.index("speed m/s"), head.index("speed m/s") + len("speed m/s"))
    rows = [line for line in out.splitlines() if line.startswith((" v1 ", " v2 "))]
    assert [line[at].strip() for line in rows] == ["4", "3"]
    assert "not shown" not in out


def test_meetings_beyond_the_limit_are_counted_with_those_of_landmarks(
    run: Any, written: Any
) -> None:
    scenario = written(
        formation={"shape": "line", "count": 100, "spacing_m": 70},
        orbit={"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "alternate"},
        landmarks_m=[[-30.0, 0.5 * k] for k in range(45)],
        duration_s=40,
    )
    out = run("plan", scenario, "--bound", "never", "--format", "table")[1]
    assert "... and 60 more rows (see the JSON)" in out
    # 99 meetings of vehicles and 45 with landmarks
    assert f"... and {99 + 45 - 40} more rows (see the JSON)" in out
    short = next(line for line in out.splitlines() if line.startswith("not certified"))
    assert "v80-v81 and 19 more: " in " ".join(out[out.index(short) :].split())
