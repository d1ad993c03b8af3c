"""The option --truth: keys of the simulated world."""

from collections.abc import Iterable
from typing import Annotated, Any

import typer

from syncplan.errors import InputError


def numeric_keys_from(incomplete: str, before: str = "") -> list[str]:
    """Return the keys that begin so, without what all of those asked for have `before` them."""
    from syncplan.scenario.dotted_keys import numeric_keys

    found = [key.removeprefix(before) for key in numeric_keys() if key.startswith(before)]
    return [key for key in found if key.startswith(incomplete)]


def _true_keys(incomplete: str) -> list[str]:
    from syncplan.scenario.dotted_keys import IN_TRUTH

    return [f"{key}=" for key in numeric_keys_from(incomplete, IN_TRUTH)]


TruthKeys = Annotated[
    list[str] | None,
    typer.Option(
        "--truth",
        help="A key that the simulated world has in place of the scenario's own, which plan, "
        "prediction and filter keep: wind.gust_sigma_mps=0.6; may be given several times",
        metavar="KEY=VALUE",
        show_default=False,
        autocompletion=_true_keys,
    ),
]


def truth_of(texts: Iterable[str] | None) -> dict[str, Any] | None:
    """Return the keys of the simulated world that --truth names, None if none.

    Raises InputError naming the option.
    """
    from syncplan.scenario.dotted_keys import IN_TRUTH, nearest_keys, numeric_keys, with_number

    document: dict[str, Any] = {}
    for text in texts or ():
        key, equals, value = text.partition("=")
        if not equals:
            problem = f"{text!r}: give a key and its value, such as wind.gust_sigma_mps=0.6"
            raise InputError(problem, key="--truth")
        if IN_TRUTH + key not in numeric_keys():
            near = [one.removeprefix(IN_TRUTH) for one in nearest_keys(IN_TRUTH + key)]
            known = [one for one in dict.fromkeys(near) if IN_TRUTH + one in numeric_keys()]
            hint = f"did you mean {' or '.join(known[:3])}?" if known else "see docs/truth.md"
            problem = f"{key!r}: no such key of the simulated world holds a number; {hint}"
            raise InputError(problem, key="--truth")
        try:
            document = with_number(document, IN_TRUTH + key, float(value))
        except ValueError:
            problem = f"{value!r}: the value of {key} must be a number"
            raise InputError(problem, key="--truth") from None
    return document.get("truth")
