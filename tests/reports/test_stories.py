"""Stories: tables have a column for each quantity, and what users name things is no mark."""

import pytest
from pydantic import BaseModel

from syncplan.results.quantities import Quantity, each, quantities_of, quantity
from syncplan.results.stories import Column, Grid, Table, html_of, marked


class Part(BaseModel):
    error_m: float = quantity("error", "RMS", "m", drop=1)
    share: float | None = quantity("share", default=None, form="%")


class Row(BaseModel):
    part: Part | None
    count: int = quantity("count", default=2)
    name: str = quantity("name", order=-1)
    hidden: float = 1.0
    word: str = quantity("word", default="x", words=each(lambda row: f"{row.word}!"))


def heads(table: Table | Grid) -> list[str]:
    return [column.quantity.head for column in table.columns(9)]


def test_columns_are_the_quantities_of_rows_and_of_their_parts() -> None:
    assert list(quantities_of(Row)) == ["name", "part.error_m", "part.share", "count", "word"]
    rows = [Row(name="a", part=Part(error_m=1.2345)), Row(name="b", part=None)]
    table = Table("t", rows)
    # a column without any value is left out
    assert heads(table) == ["name", "error m", "count", "word"]
    cells = [column.cells for column in table.columns(9)]
    assert cells == [["a", "b"], ["1.23", "-"], ["2", "2"], ["x!", "x!"]]
    assert heads(Table("t", rows, stated="m", without=["count"])) == ["name", "error", "word"]
    rows[1] = Row(name="b", part=Part(error_m=2.0, share=0.125))
    assert Table("t", rows).columns(9)[2].cells == ["-", "12.5 %"]


def test_a_table_has_its_foot_and_columns_beside_it() -> None:
    rows = [Row(name=name, part=Part(error_m=2.0)) for name in "abc"]
    beside = [Column(Quantity("further"), ["1", "2", "3"])]
    table = Table("t", rows, foot=Row(name="", part=Part(error_m=3.0)), beside=beside)
    name, error, *_, further = table.columns(2)
    assert name.cells == ["a", "b", "overall"]
    assert error.cells == ["2", "2", "3"]
    assert further.cells == ["1", "2"]


def test_the_schema_says_what_a_quantity_is() -> None:
    found = Row.model_json_schema()["$defs"]["Part"]["properties"]["error_m"]
    assert found["description"] == "RMS"


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("[bold green]GO[/]: <b>", '<span class="bold green">GO</span>: &lt;b&gt;'),
        (r"\[bold] and [0, 1]", "[bold] and [0, 1]"),
    ],
)
def test_marks_become_classes_and_nothing_else_becomes_html(text: str, html: str) -> None:
    assert marked(text) == html


def test_stories_are_lines_and_tables_anywhere() -> None:
    grid = Grid("a title", ("name", "x"), [("[red]v1[/]", "1"), ("v2", "2")])
    text = html_of(["a [green]line[/]", grid])
    assert text.startswith('<p>a <span class="green">line</span></p>\n<table><caption>a title')
    assert '<tr><th scope="row"><span class="red">v1</span></th><td>1</td></tr>' in text
