"""What a client accepts and what it sends: 406 and 415 where the service can't serve that."""

import re
from collections.abc import Awaitable, Callable
from typing import Literal

from fastapi import Request

from api.problems import ServiceError

_TOKEN = r"[!#$%&'*+.^_`|~0-9A-Za-z-]+"
_RANGE = re.compile(rf"({_TOKEN})/({_TOKEN})", re.ASCII)
_PARAMETER = re.compile(rf'({_TOKEN})=({_TOKEN}|"[^"]*")', re.ASCII)
_WEIGHT = re.compile(r"0(\.\d{0,3})?|1(\.0{0,3})?", re.ASCII)
_JSON = re.compile(rf"application/(json|{_TOKEN}\+json)", re.ASCII)
_YAML = {"application/yaml", "text/yaml", "application/x-yaml"}
_UTF8 = {"utf-8", "utf8", "us-ascii"}
ARCHIVES = (
    "application/zip",
    "application/x-tar",
    "application/gzip",
    "application/x-xz",
    "application/x-bzip2",
    "application/octet-stream",
)
"""What archives may be sent as; which kind one is shows in its bytes."""

_BODIES = "application/json or application/yaml, in UTF-8"


def accepts(*media: str) -> Callable[[Request], Awaitable[str]]:
    """Return a dependency: which of `media` the client likes best, the first one if all the same.

    It raises the problem 406 where the Accept header excludes them all; a header that can't be
    read accepts everything (RFC 9110, section 12.5.1).
    """

    async def chosen(request: Request) -> str:
        ranges = _ranges(",".join(request.headers.getlist("accept")))
        best = max(media, key=lambda medium: _weight(medium, ranges))
        if _weight(best, ranges) > 0.0:
            return best
        raise ServiceError(
            406, f"the Accept header excludes {' and '.join(media)}, which is all there is here"
        )

    return chosen


def _ranges(header: str) -> dict[str, float]:
    """The weight of each media range; everything, if the header is empty or can't be read."""
    found: dict[str, float] = {}
    for part in filter(None, (part.strip() for part in header.split(","))):
        medium, *parameters = (piece.strip() for piece in part.split(";"))
        medium = medium.lower()
        named = _RANGE.fullmatch(medium)
        weight = _quality(parameters)
        if named is None or weight is None or (named[1] == "*" and named[2] != "*"):
            return {"*/*": 1.0}
        found[medium] = max(weight, found.get(medium, 0.0))
    return found or {"*/*": 1.0}


def _quality(parameters: list[str]) -> float | None:
    weight = 1.0
    for parameter in filter(None, parameters):
        named = _PARAMETER.fullmatch(parameter)
        if named is None:
            return None
        if named[1].lower() == "q":
            if not _WEIGHT.fullmatch(named[2]):
                return None
            weight = float(named[2])
    return weight


def _weight(medium: str, ranges: dict[str, float]) -> float:
    """The weight of a medium: that of the most specific range it lies in."""
    family = medium.partition("/")[0]
    for name in (medium, f"{family}/*", "*/*"):
        if name in ranges:
            return ranges[name]
    return 0.0


def body_kind(request: Request) -> Literal["json", "yaml"]:
    """Return how the body of a request is written, by its Content-Type.

    Raises the problem 415 for anything but JSON and YAML in UTF-8. An empty body needs no type.
    """
    _check_coding(request)
    headers = request.headers
    given = headers.getlist("content-type")
    if not given or not given[0].strip():
        if headers.get("content-length", "0") == "0" and "transfer-encoding" not in headers:
            return "json"
        raise _unsupported("no Content-Type", f"the body must be {_BODIES}")
    medium, *parameters = (piece.strip() for piece in given[0].split(";"))
    medium = medium.lower()
    kind = _kind(medium)
    if len(given) > 1 or kind is None:
        raise _unsupported(", ".join(given), f"the body must be {_BODIES}")
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        if name.strip().lower() == "charset" and value.strip(' "').lower() not in _UTF8:
            raise _unsupported(given[0], f"the body must be {_BODIES}")
    return kind


def check_archive(request: Request) -> None:
    """Raise the problem 415 where the body of a request is not sent as an archive."""
    _check_coding(request)
    given = request.headers.getlist("content-type")
    medium = given[0].partition(";")[0].strip().lower() if len(given) == 1 else ""
    if medium not in ARCHIVES:
        what = ", ".join(given) or "no Content-Type"
        accepted = ", ".join(ARCHIVES)
        problem = f"{what[:100]}: the body must be a zip or tar archive, sent as one of {accepted}"
        raise ServiceError(415, problem, headers={"Accept": accepted})


def _check_coding(request: Request) -> None:
    coding = request.headers.get("content-encoding", "identity").strip().lower()
    if coding not in ("", "identity"):
        raise _unsupported(f"Content-Encoding {coding}", "the body must not be compressed")


def _kind(medium: str) -> Literal["json", "yaml"] | None:
    if _JSON.fullmatch(medium):
        return "json"
    return "yaml" if medium in _YAML else None


def _unsupported(what: str, allowed: str) -> ServiceError:
    return ServiceError(
        415, f"{what[:100]}: {allowed}", headers={"Accept": "application/json, application/yaml"}
    )
