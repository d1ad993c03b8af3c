"""Scenario files with further landmarks: all else as it was written, with its comments."""

import io
from collections.abc import Mapping
from typing import Any

from syncplan.errors import InputError
from syncplan.runtime.files import as_text
from syncplan.scenario.loading import is_plan, parse_document, scenario_from
from syncplan.scenario.quantities import Point

_WIDEST = 4096


def with_landmarks(
    text: str, source: str, landmarks: Mapping[str, Point], *, as_json: bool = False
) -> str:
    """Return a scenario file's text with the landmarks given, m by name, in place of its own.

    Of YAML, comments, order and style of the other keys are kept. Of a plan file, the scenario is
    written. Raises InputError where what comes out is no scenario.
    """
    document = parse_document(text, source)
    whole: dict[str, Any] = document["scenario"] if is_plan(document) else document
    named = {name: [_plain(x), _plain(y)] for name, (x, y) in landmarks.items()}
    if as_json:
        edited = as_text({**whole, "landmarks_m": named})
    elif whole is document and not text.lstrip().startswith("{"):
        edited = _edited_yaml(text, named)
    else:
        edited = _as_yaml({**whole, "landmarks_m": named})
    try:
        # a team beyond the usual limit was let in when the file was loaded
        scenario_from(parse_document(edited, ""), max_vehicles=len(edited))
    except InputError as error:
        raise InputError(
            f"can't be written with its landmarks: {error.problem}", key=error.key, source=source
        ) from None
    return edited


def _edited_yaml(text: str, landmarks: dict[str, list[float]]) -> str:
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = _WIDEST
    document = yaml.load(text)
    document["landmarks_m"] = _mapping(landmarks)
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


def _mapping(landmarks: dict[str, list[float]]) -> Any:
    """A name a line, each with its position in brackets."""
    from ruamel.yaml.comments import CommentedMap, CommentedSeq

    mapping = CommentedMap()
    for name, place in landmarks.items():
        mapping[name] = CommentedSeq(place)
        mapping[name].fa.set_flow_style()
    return mapping


def _plain(value: float) -> float:
    """A coordinate as a person would write it: whole numbers without a point."""
    return int(value) if value == int(value) else float(value)
