"""The keys of a scenario as tables, from the JSON Schema that checks them."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from syncplan.scenario.formations import SHAPES
from syncplan.scenario.specification import Scenario

__all__ = ["described_keys", "keys_page", "unit_of"]

Schema = Mapping[str, Any]

UNITS = (
    ("_rad_s", "rad/s"),
    ("_mps", "m/s"),
    ("_rad", "rad"),
    ("_deg", "degree"),
    ("_m", "m"),
    ("_s", "s"),
)
"""What a key ends with, and the unit that it says; longer endings first."""

_INTRODUCTION = """# Scenario keys

A scenario is a YAML 1.2 or JSON file. Unknown keys are faults; the message of a fault states file,
key, value and what is allowed. The tables come from the JSON Schema that `syncplan schema scenario`
prints; [Plan a formation](../how-to/plan-a-formation.md) shows the keys at work.
"""


def keys_page() -> str:
    """Return the page: a table of the top, and one for each section."""
    schema = Scenario.model_json_schema()
    parts = [_INTRODUCTION]
    for title, rows in described_keys(schema):
        parts.append(f"## {title}\n")
        parts.append(
            "| key | type | unit | default | meaning | example |\n|---|---|---|---|---|---|"
        )
        parts.append("\n".join(f"| {' | '.join(row)} |" for row in rows) + "\n")
    parts.append("## Shapes of a formation\n\n| shape | centres |\n|---|---|")
    parts.append("\n".join(f"| `{one.name}` | {one.sentence} |" for one in SHAPES.values()) + "\n")
    return "\n".join(parts)


def described_keys(schema: Schema) -> Iterator[tuple[str, list[list[str]]]]:
    """Yield (section, rows) with key, type, unit, default, meaning and example in Markdown."""
    definitions = schema["$defs"]
    yield "Top level", _rows(schema, definitions)
    named, parts = set(), [schema]
    for part in parts:
        for name, described in part["properties"].items():
            section = _section(described)
            # keys of the truth are those of the section that has their name
            if section is not None and name not in named:
                named.add(name)
                parts.append(definitions[section])
                yield f"`{name}`", _rows(definitions[section], definitions)


def unit_of(key: str) -> str:
    """Return the unit that a key's name ends with, or nothing."""
    return next((unit for ending, unit in UNITS if key.endswith(ending)), "")


def _rows(schema: Schema, definitions: Schema) -> list[list[str]]:
    required = set(schema.get("required", ()))
    return [
        _row(key, described, key in required, definitions)
        for key, described in schema["properties"].items()
    ]


def _row(key: str, described: Schema, required: bool, definitions: Schema) -> list[str]:
    section = _section(described)
    meaning = described.get("description") or definitions[section or ""]["description"]
    default = "required" if required else _literal(described.get("default"))
    examples = described.get("examples") or []
    example = _literal(examples[0]) if examples else ""
    kind = f"section [{key}](#{key})" if section else _kind(described)
    return [f"`{key}`", _cell(kind), unit_of(key), default, _cell(meaning), example]


def _section(described: Schema) -> str | None:
    """The model behind a key whose value is a section, or a list of them."""
    if "$ref" in described:
        return str(described["$ref"].rpartition("/")[2])
    each = map(_section, (*described.get("anyOf", ()), *described.get("oneOf", ())))
    return next(filter(None, each), None)


def _kind(described: Schema) -> str:
    """The type in words, with its limits."""
    choices = [*described.get("anyOf", ()), *described.get("oneOf", ())]
    if choices:
        kinds = [_kind(one) for one in choices if one.get("type") != "null"]
        return " or ".join(dict.fromkeys(kinds))
    if "enum" in described:
        return ", ".join(f"`{value}`" for value in described["enum"])
    kind = described["type"]
    if kind == "array":
        if "prefixItems" in described:
            inner = [_kind(one) for one in described["prefixItems"]]
            return f"{len(inner)} values: {', '.join(dict.fromkeys(inner))}"
        return f"list of ({_kind(described['items'])})"
    if kind == "object":
        return f"mapping of names to ({_kind(described['additionalProperties'])})"
    words = {"string": "text", "integer": "whole number", "boolean": "true or false"}.get(
        kind, kind
    )
    limits = [
        f"{sign} {described[bound]:g}"
        for bound, sign in (
            ("minimum", "≥"),
            ("exclusiveMinimum", ">"),
            ("maximum", "≤"),
            ("exclusiveMaximum", "<"),
        )
        if bound in described
    ]
    return f"{words} {', '.join(limits)}".strip()


def _literal(value: Any) -> str:
    if value is None or value == "":
        return ""
    return f"`{value if isinstance(value, str) else json.dumps(value)}`"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
