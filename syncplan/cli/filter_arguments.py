"""Options of the filter that several commands share: which one, and its gate."""

from enum import StrEnum
from typing import Annotated

import typer

from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filters import AUTO, FILTERS

Choice = StrEnum("Choice", {name: name for name in (AUTO, *FILTERS)})  # type: ignore[misc]
DEFAULT_CHOICE = Choice(FilterOptions().filter)

Gate = Annotated[
    float | None,
    typer.Option(help="Probability of the innovation gate, such as 0.999", show_default=False),
]
