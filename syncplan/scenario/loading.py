"""Scenarios from YAML 1.2 or JSON, in a file or on standard input; each fault is one line."""

import contextlib
import io
import json
import math
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from syncplan.errors import InputError
from syncplan.runtime.files import as_text
from syncplan.scenario.lat_lon_keys import has_lat_lon, in_lat_lon
from syncplan.scenario.models import MAX_VEHICLES
from syncplan.scenario.other_documents import refuse_other_documents
from syncplan.scenario.quantities import Point, described, validation_fault
from syncplan.scenario.specification import Scenario

LARGEST_FILE_BYTES = 64 * 2**20
FEWEST_VALUES = 10_000
"""Values that a YAML document may hold, however short it is. A longer one may hold one for each
character, which no document without aliases exceeds."""

Syntax = Literal["json", "yaml"]


def load_scenario(path: str | Path, *, max_vehicles: int = MAX_VEHICLES) -> Scenario:
    """Return the scenario of a YAML 1.2 or JSON file; "-" reads standard input.

    Raises InputError naming the file, the key, its value and what is allowed.
    """
    name, text = read_text(path)
    document = parse_document(text, name)
    if is_plan(document):
        raise InputError(
            "is already a plan; syncplan.load_plan and commands that take a plan read it as it is, "
            "and its 'scenario' section can be planned again",
            source=name,
        )
    return scenario_from(document, source=name, max_vehicles=max_vehicles)


def scenario_of(given: Scenario | str | Path | Mapping[str, Any]) -> Scenario:
    """Return a scenario unchanged, or that of a file's path or of a mapping of keys.

    Raises InputError for anything else, and as load_scenario does.
    """
    if isinstance(given, Scenario):
        return given
    if isinstance(given, str | Path):
        return load_scenario(given)
    if isinstance(given, Mapping):
        return scenario_from(given)
    raise InputError(
        f"is a {type(given).__name__}; give a Scenario, the path of its file or a mapping of keys",
        key="scenario",
    )


def is_plan(document: Mapping[str, Any]) -> bool:
    """Return whether a document is a plan rather than a scenario, by its keys."""
    return "scenario" in document and "vehicles" in document


def read_text(path: str | Path) -> tuple[str, str]:
    """Return (name to show, text) of a file or, for "-", of standard input."""
    name, data = read_bytes(path)
    return name, decoded(data, name)


def read_bytes(path: str | Path) -> tuple[str, bytes]:
    """Return (name to show, content) of a file or, for "-", of standard input."""
    name = "standard input" if str(path) == "-" else str(path)
    try:
        if str(path) == "-" and sys.stdin is None:
            raise InputError("is closed", source=name)
        if str(path) == "-":
            data = sys.stdin.buffer.read(LARGEST_FILE_BYTES + 1)
        else:
            with Path(path).open("rb") as file:
                data = file.read(LARGEST_FILE_BYTES + 1)
    except FileNotFoundError:
        raise InputError("no such file; check the path", source=name) from None
    except IsADirectoryError:
        raise InputError("is a directory; give a file", source=name) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"can't be read: {reason}", source=name) from None
    if len(data) > LARGEST_FILE_BYTES:
        raise InputError(f"is larger than {LARGEST_FILE_BYTES // 2**20} MiB", source=name)
    return name, data


def decoded(data: bytes, source: str) -> str:
    """Return bytes as text; raises InputError if they are empty or not UTF-8."""
    text = text_of(data, source, "YAML or JSON")
    if not text.strip():
        raise InputError(
            "is empty; see 'syncplan schema' for what a scenario contains", source=source
        )
    return text


def text_of(data: bytes, source: str, formats: str) -> str:
    """Return bytes as text; raises InputError naming the formats to give if they are not UTF-8."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        problem = f"is not text: byte {error.start} is not UTF-8; give {formats}"
        raise InputError(problem, source=source) from None


def parse_document(text: str, source: str, syntax: Syntax | None = None) -> dict[str, Any]:
    """Return the mapping a JSON or YAML 1.2 text holds; see parse_values."""
    document = parse_values(text, source, syntax)
    if not isinstance(document, dict):
        raise InputError(
            f"holds {described(document)} where a mapping of keys is expected; "
            "see 'syncplan schema'",
            source=source,
        )
    return document


def parse_values(text: str, source: str, syntax: Syntax | None = None) -> Any:
    """Return the value of a JSON or YAML 1.2 text, a mapping or not.

    Without a syntax, the source's name or the text decides.
    """
    document = None
    if syntax == "json" or (syntax is None and source.endswith(".json")):
        document = _parse_json(text, source)
    elif text.lstrip().startswith("{"):
        # flow-style YAML starts with a brace too
        with contextlib.suppress(InputError):
            document = _parse_json(text, source)
    if document is None:
        document = _parse_yaml(text, source)
    return document


def _parse_json(text: str, source: str) -> Any:
    try:
        return json.loads(text, object_pairs_hook=_without_repeats)
    except RecursionError:
        raise InputError("is nested too deeply", source=source) from None
    except ValueError as error:
        raise InputError(f"not valid JSON: {error}", source=source) from None


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    repeated = [key for key, times in Counter(key for key, _ in pairs).items() if times > 1]
    if repeated:
        raise ValueError(f"duplicate key {repeated[0]!r}")
    return dict(pairs)


def _parse_yaml(text: str, source: str) -> Any:
    from ruamel.yaml.error import MarkedYAMLError

    from syncplan.scenario.bounded_yaml import TooMuchYAMLError, load_yaml

    try:
        values = load_yaml(text)
        if _count(values, {}) > max(len(text), FEWEST_VALUES):
            raise InputError("its aliases expand to too many values; write them out", source=source)
        return values
    except MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        what = " ".join(str(error.problem or error.context or "unreadable").split())
        fault = "" if isinstance(error, TooMuchYAMLError) else "not valid YAML: "
        raise InputError(f"{place}{fault}{what}", source=source) from None
    except RecursionError:
        raise InputError("is nested too deeply", source=source) from None
    except (InputError, MemoryError):
        raise
    except Exception as error:
        # the parser also raises other errors: an AssertionError for a repeated key in !!omap
        what = " ".join(str(error).split())[:200] or "can't be read"
        raise InputError(f"not valid YAML: {what}", source=source) from None


def _count(value: Any, known: dict[int, float]) -> float:
    """Number of values in a value, itself and each alias counted; inf if it contains itself."""
    if not isinstance(value, list | dict | set | tuple):
        return 1.0
    count = known.get(id(value))
    if count is None:
        known[id(value)] = math.inf
        inner = [*value, *value.values()] if isinstance(value, dict) else value
        count = known[id(value)] = 1.0 + sum(_count(one, known) for one in inner)
    return count


def scenario_from(
    document: Mapping[str, Any], *, source: str = "", max_vehicles: int = MAX_VEHICLES
) -> Scenario:
    """Return the checked scenario of a mapping; `source` names it in messages."""
    refuse_other_documents(document, source)
    try:
        return Scenario.model_validate(dict(document), context={"max_vehicles": max_vehicles})
    except ValidationError as error:
        validation_fault(error, Scenario, source)
    except RecursionError:
        raise InputError("is nested too deeply", source=source) from None


# --- files with further landmarks -----------------------------------------------------------------


_WIDEST = 4096


def with_landmarks(
    text: str, source: str, landmarks: Mapping[str, Point], *, as_json: bool = False
) -> str:
    """Return a scenario file's text with the given landmarks, in m by name, in place of its own.

    YAML keeps comments, order and the style of the other keys. Where places are in degrees, so are
    the landmarks, and the origin is stated. A plan file yields its scenario.
    Raises InputError if the result is not a scenario.
    """
    document = parse_document(text, source)
    whole: dict[str, Any] = document["scenario"] if is_plan(document) else document
    keys = _landmark_keys(whole, landmarks)
    if as_json:
        edited = as_text({**whole, **keys})
    elif whole is document and not text.lstrip().startswith("{"):
        edited = _edited_yaml(text, keys)
    else:
        edited = _as_yaml({**whole, **keys})
    try:
        # loading the file has accepted any team beyond the usual limit
        scenario_from(parse_document(edited, ""), max_vehicles=sys.maxsize)
    except InputError as error:
        raise InputError(
            f"can't be written with its landmarks: {error.problem}", key=error.key, source=source
        ) from None
    return edited


def _landmark_keys(document: Mapping[str, Any], landmarks: Mapping[str, Point]) -> dict[str, Any]:
    """The keys of landmarks in m, or in degrees with their origin if a document has degrees."""
    if not has_lat_lon(document):
        return {"landmarks_m": {name: [_plain(x), _plain(y)] for name, (x, y) in landmarks.items()}}
    origin = scenario_from(document, max_vehicles=sys.maxsize).geo_origin
    assert origin is not None
    return {
        "geo_origin": origin.model_dump(),
        "landmarks_lat_lon_deg": in_lat_lon(origin, landmarks),
    }


def _edited_yaml(text: str, keys: Mapping[str, Any]) -> str:
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = _WIDEST
    document = yaml.load(text)
    document.update({key: _laid_out(value) for key, value in keys.items()})
    return _dumped(yaml, document)


def _as_yaml(document: dict[str, Any]) -> str:
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.width = _WIDEST
    yaml.default_flow_style = None
    return _dumped(yaml, document)


def _dumped(yaml: Any, document: Any) -> str:
    stream = io.StringIO()
    yaml.dump(document, stream)
    return stream.getvalue()


def _laid_out(value: Any) -> Any:
    """A value with each name on a line of its own, and each list in brackets."""
    from ruamel.yaml.comments import CommentedMap, CommentedSeq

    if isinstance(value, Mapping):
        return CommentedMap({name: _laid_out(inner) for name, inner in value.items()})
    if isinstance(value, list):
        listed = CommentedSeq(value)
        listed.fa.set_flow_style()
        return listed
    return value


def _plain(value: float) -> float:
    """A coordinate as a person would write it: whole numbers without a point."""
    return int(value) if value == int(value) else float(value)
