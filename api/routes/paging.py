"""Lists a page at a time: newest first, each page naming the next."""

from collections.abc import Sequence
from typing import Annotated, TypeVar
from urllib.parse import urlencode

from fastapi import Query

Row = TypeVar("Row")

Limit = Annotated[int, Query(ge=1, le=200, description="Most entries on a page")]
Before = Annotated[
    str | None,
    Query(pattern=r"^[0-9a-f-]{36}$", description="Cursor: entries older than this identifier"),
]


def page_and_next(
    path: str, rows: Sequence[Row], identifiers: Sequence[str], limit: int, **chosen: str | None
) -> tuple[Sequence[Row], str | None]:
    """Return the first `limit` rows, and where the next page is; None if there are no more.

    `chosen` are the parameters that selected the rows.
    """
    if len(rows) <= limit:
        return rows, None
    query = {"limit": limit, "before": identifiers[limit - 1], **chosen}
    return rows[:limit], f"{path}?{urlencode({k: v for k, v in query.items() if v is not None})}"
