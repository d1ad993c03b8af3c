"""The service as pages, from its OpenAPI document, its settings and its table of problems."""

import json
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from api.failures import NO_SOLUTION
from api.main import create_app
from api.settings import PREFIX, Settings

__all__ = ["operations_page", "problems_page", "settings_page", "settings_table"]

Tree = Mapping[str, Any]

_LONGEST_EXAMPLE = 24
"""Lines of an example that are shown; the OpenAPI document has all of it."""
_MOST_NAMED = 4
"""Operations that are named where they share a problem."""

_SERVICE = """# REST API

`syncplan serve` answers at the paths below. `GET /openapi.json` is the same as an OpenAPI 3.1
document with whole examples, recorded from the service itself; here they are shortened. Bodies are
JSON or YAML, answers JSON. [Run the service](../how-to/service.md) shows the paths at work,
[Settings](settings.md) lists what an operator may set, and [Problems](problems.md) the errors.
"""

_PROBLEMS = """# Problems

Errors are problem documents (RFC 9457), `application/problem+json`: `title` and `status`, `detail`
in a sentence, `errors` with up to twenty faults of a scenario (`path`, `value`, `message`), and
`request_id`, by which to find the request in the log.

| status | title | for example | answered by |
|---|---|---|---|
"""

_SETTINGS = """# Settings

Environment variables of `syncplan serve` and `syncplan worker`, all optional.

"""


@cache
def _document() -> Tree:
    document: Tree = create_app().openapi()
    return document


def settings_page() -> str:
    """Return the page of settings."""
    return _SETTINGS + settings_table() + "\n"


def settings_table() -> str:
    """Return the table of settings: variable, default, meaning."""
    rows = ["| variable | default | what it is |", "|---|---|---|"]
    for name, field in Settings.model_fields.items():
        default = field.get_default(call_default_factory=True)
        if isinstance(default, Path):
            # not this machine's own
            shown = "~/.local/share/syncplan"
        elif isinstance(default, bool):
            shown = str(default).lower()
        elif isinstance(default, int | float):
            shown = f"{default:.12g}"
        else:
            shown = default or ""
        shown = f"`{shown}`" if shown else ""
        rows.append(f"| `{PREFIX}{name.upper()}` | {shown} | {field.description} |")
    return "\n".join(rows)


def problems_page() -> str:
    """Return the page of problems: every status that any operation answers with."""
    found: dict[str, tuple[Tree, list[str]]] = {}
    for _, _, operation in _operations():
        for status, response in operation["responses"].items():
            if int(status) >= 400:
                by = found.setdefault(status, (response, []))[1]
                by.append(f"[{operation['operationId']}](service.md#{_anchor(operation)})")
    rows = []
    for status in sorted(found):
        response, by = found[status]
        detail = _cell(_first_example(response)["detail"])
        named = ", ".join(by) if len(by) <= _MOST_NAMED else f"{len(by)} operations"
        rows.append(f"| {status} | {response['description']} | {detail} | {named} |")
    return (
        _PROBLEMS
        + "\n".join(rows)
        + "\n\nWhatever the path, the service also answers 400 to a request that it cannot read, "
        "404 to an unknown path, 405 to a method that the path does not take, 408 to one that "
        "comes too slowly, 421 or 403 to one for another host or from another's page while there "
        "are no keys, 431 to a head or framing above 64 KiB, and 503 to a connection too many.\n\n"
        "A scenario that is sound, but has no solution, is a 422 of the type "
        + f"`{NO_SOLUTION}`; all others are `about:blank`.\n"
    )


def operations_page() -> str:
    """Return the page of operations: parameters, bodies, answers, examples."""
    parts = [_SERVICE]
    for method, path, operation in _operations():
        parts += [
            f"## {operation['summary']} {{ #{_anchor(operation)} }}\n",
            f"`{method.upper()} {path}`\n",
            operation.get("description", "").strip() + "\n",
            *_parameters(operation),
            *_body(operation),
            *_answers(operation),
        ]
    return "\n".join(parts)


def _operations() -> Iterator[tuple[str, str, Tree]]:
    for path, item in _document()["paths"].items():
        for method, operation in item.items():
            if method != "parameters":
                yield method, path, operation


def _anchor(operation: Tree) -> str:
    return str(operation["operationId"]).lower()


def _parameters(operation: Tree) -> Iterator[str]:
    parameters = operation.get("parameters", [])
    if parameters:
        yield "| parameter | in | type | meaning |\n|---|---|---|---|"
        for one in parameters:
            needed = ", required" if one.get("required") else ""
            kind = _kind(one["schema"])
            meaning = _cell(one.get("description", one["schema"].get("description", "")))
            yield f"| `{one['name']}` | {one['in']}{needed} | {kind} | {meaning} |"
        yield ""


def _body(operation: Tree) -> Iterator[str]:
    body = operation.get("requestBody")
    if body is None:
        return
    kinds = ", ".join(f"`{kind}`" for kind in body["content"])
    content = next(iter(body["content"].values()))
    yield f"**Body** ({kinds}; schema `{_kind(content['schema'])}`): {body['description']}\n"
    yield from _examples(content, "json")


def _answers(operation: Tree) -> Iterator[str]:
    for status, response in operation["responses"].items():
        if int(status) >= 400:
            continue
        yield f"**{status}**: {response['description']}\n"
        headers = [f"`{name}`" for name in response.get("headers", {})]
        if headers:
            yield f"Headers: {', '.join(headers)}\n"
        for media, content in response.get("content", {}).items():
            yield from _examples(content, "json" if media.endswith("json") else "text")
    wrong = [status for status in operation["responses"] if int(status) >= 400]
    listed = ", ".join(f"[{status}](problems.md)" for status in wrong)
    yield f"Problems: {listed}\n"


def _examples(content: Tree, language: str) -> Iterator[str]:
    """The first example of a body or an answer, long lists and texts cut."""
    example = _first_example({"content": {"": content}})
    if example is None:
        return
    text = (
        example if isinstance(example, str) else json.dumps(example, indent=1, ensure_ascii=False)
    )
    lines = text.splitlines()
    if len(lines) > _LONGEST_EXAMPLE:
        # no JSON any more
        language = "text"
        lines = [*lines[:_LONGEST_EXAMPLE], f"... {len(lines) - _LONGEST_EXAMPLE} more lines"]
    yield f"```{language}"
    yield from lines
    yield "```\n"


def _first_example(response: Tree) -> Any:
    for content in response.get("content", {}).values():
        if "examples" in content:
            return next(iter(content["examples"].values()))["value"]
        return content.get("example")
    return None


def _kind(schema: Tree) -> str:
    if "$ref" in schema:
        return str(schema["$ref"].rpartition("/")[2])
    if "anyOf" in schema:
        return " or ".join(_kind(one) for one in schema["anyOf"])
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    limits = [f"{schema[key]:g}" for key in ("minimum", "maximum") if key in schema]
    kind = str(schema.get("type", "any"))
    return f"{kind}, {' to '.join(limits)}" if limits else kind


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
