"""The web page and its files: static, from this service alone, under a strict policy.

It consists of its own files, the library's tables, examples, and Plotly.
"""

import gzip
import hashlib
import json
import re
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Self

from fastapi import APIRouter, Request, Response

from api.job_kinds.job_table import JOB_KINDS
from api.limits import RequestLimits
from api.problems import NotFound
from api.routes.brief_form import brief_form
from api.routes.study_routes import described_studies
from api.service import limits_of
from api.settings import Settings
from syncplan.exporting.format_table import AUTOPILOTS, FORMATS
from syncplan.plotting.figure_table import FIGURES, always_there
from syncplan.plotting.printed_report import STYLE_DIGEST
from syncplan.plotting.vendored import plotly_script
from syncplan.scenario.dotted_keys import ALTERNATIVES, all_numeric_keys
from syncplan.scenario.formations import SHAPES
from syncplan.scenario.objectives import OBJECTIVES
from syncplan.studies.job_contract import STATES, has_ended
from syncplan.terms import TERMS


@dataclass(frozen=True, slots=True)
class Tiles:
    """Map tiles that the operator sets: the template of their addresses, and a text for them."""

    url: str
    attribution: str

    @property
    def origin(self) -> str:
        """Scheme and host that the page may load images from."""
        return "/".join(self.url.split("/")[:3])


@dataclass(frozen=True, slots=True)
class Site:
    """What the page of a service has of its settings."""

    limits: RequestLimits
    tiles: Tiles | None = None

    @classmethod
    def of(cls, settings: Settings) -> Self:
        """Return what the page has of some settings."""
        tiles = Tiles(settings.tiles, settings.tiles_attribution) if settings.tiles else None
        return cls(limits_of(settings), tiles)


_OF_FORMATS = ("title", "holds", "altitude_m", "on_earth", "mission")
"""Attributes of export formats that the page states."""


def tables_script(site: Site) -> str:
    """Return the library's tables as JavaScript: names and words, in the order of the page."""
    pilots = {
        f"autopilot={name}&vehicle={vehicle}": title
        for name, autopilot in AUTOPILOTS.items()
        for vehicle, title in autopilot.titles.items()
    }
    of_plans = [kind for kind in JOB_KINDS.values() if kind.about == "plan"]
    drawn = {"plan", *(kind.figures for kind in of_plans)}
    # a comparison of two plans is what their reader looks at first
    figures = sorted(
        (name for name, figure in FIGURES.items() if figure.of in drawn),
        key=lambda name: (name not in always_there("plan"), not FIGURES[name].compares),
    )
    tables = {
        "FIGURES": {name: FIGURES[name].title for name in figures},
        "PLAN_FIGURES": always_there("plan"),
        "FORMATS": {
            name: {key: getattr(form, key) for key in _OF_FORMATS} for name, form in FORMATS.items()
        },
        "SHAPES": {name: one.sentence for name, one in SHAPES.items()},
        "PILOTS": pilots,
        "OBJECTIVES": {name: one.title for name, one in OBJECTIVES.items()},
        "MEANINGS": {key: one.meaning for key, one in all_numeric_keys().items()},
        "TERMS": {form: one.meaning for name, one in TERMS.items() for form in (name, *one.forms)},
        "ALTERNATIVES": ALTERNATIVES,
        "STUDIES": {
            study.name: study.model_dump(mode="json", exclude={"fields"})
            for study in described_studies(site.limits)
        },
        "BRIEF": brief_form(),
        "TILES": None if site.tiles is None else asdict(site.tiles),
        "ENDED": [state for state in STATES if has_ended(state)],
    }
    lines = [f"export const {name} = {json.dumps(table)};" for name, table in tables.items()]
    return "\n".join(lines) + "\n"


# --- files ----------------------------------------------------------------------------------------


PAGE = "index.html"
PLOTLY = "plotly.min.js"
TABLES = "tables.js"
"""Module with the choices that the library offers, which the page imports."""

_MEDIA = {
    "css": "text/css; charset=utf-8",
    "html": "text/html; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
    "woff2": "font/woff2",
    "yaml": "application/yaml",
}
_EXAMPLE = re.compile(rb'<script type="application/yaml" id="([\w-]+)">')
"""Where the page has an example within it."""

_FOLDERS = ("examples", "briefs", "vendor")
_LEVEL = 6
_FAST = 3


@dataclass(frozen=True, slots=True)
class Asset:
    """A file to send.

    Attributes
    ----------
    compressed : content compressed by gzip, for clients that accept it
    etag : digest of the content
    """

    content: bytes
    compressed: bytes
    media_type: str
    etag: str


def find_asset(name: str, site: Site) -> Asset | None:
    """Return a file by its name, or None; those of folders are examples/NAME.yaml, ..."""
    return _asset(name, site) if name in _names() else None


@lru_cache
def edition(site: Site) -> str:
    """Digest of all files that the page names, each under assets/EDITION/: none changes there."""
    digests = [_asset(name, site).etag for name in sorted(_names() - {PAGE, PLOTLY})]
    return hashlib.sha256("".join(digests).encode()).hexdigest()[:12]


@lru_cache
def _names() -> frozenset[str]:
    """Names of all files; no other name is served."""
    folder = files("api").joinpath("page")
    own = [one.name for one in folder.iterdir() if one.is_file()]
    further = [f"{of}/{one.name}" for of in _FOLDERS for one in folder.joinpath(of).iterdir()]
    known = [name for name in (*own, *further) if name.rpartition(".")[2] in _MEDIA]
    return frozenset((*known, PLOTLY, TABLES))


@lru_cache
def _asset(name: str, site: Site) -> Asset:
    """File of a name, kept because compressing Plotly's script takes a while."""
    content = _content(name, site)
    return Asset(
        content=content,
        compressed=gzip.compress(content, _LEVEL, mtime=0),
        media_type=_MEDIA[name.rpartition(".")[2]],
        etag=hashlib.sha256(content).hexdigest()[:32],
    )


def _content(name: str, site: Site) -> bytes:
    if name == PLOTLY:
        return plotly_script().encode()
    if name == TABLES:
        return tables_script(site).encode()
    if name == PAGE:
        page = _EXAMPLE.sub(_with_example, _file(name))
        return page.replace(b'"assets/', f'"assets/{edition(site)}/'.encode())
    return _file(name)


def _with_example(element: re.Match[bytes]) -> bytes:
    return element[0] + _file(f"examples/{element[1].decode()}.yaml")


def _file(name: str) -> bytes:
    return files("api").joinpath("page", *name.split("/")).read_bytes()


# --- routes ---------------------------------------------------------------------------------------


router = APIRouter(include_in_schema=False)

_PLOTLY_STYLE = "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='"
"""Digest of the empty style element that Plotly adds."""


def policy(tiles: Tiles | None = None) -> str:
    """Return the page's content policy: no inline script or style, and only tiles from elsewhere.

    A printed report has its style inline: the page opens it as text of its own, since a new tab
    could not present a key.
    """
    images = "img-src 'self' data: blob:" + (f" {tiles.origin}" if tiles else "")
    return "; ".join(
        (
            "default-src 'none'",
            "script-src 'self'",
            f"style-src 'self' {_PLOTLY_STYLE} {STYLE_DIGEST}",
            images,
            "connect-src 'self'",
            "font-src 'self'",
            "base-uri 'none'",
            "form-action 'none'",
            "frame-ancestors 'none'",
        )
    )


@router.api_route("/", methods=["GET", "HEAD"])
def read_page(request: Request) -> Response:
    """Return the page."""
    site = Site.of(request.app.state.settings)
    return _sent(request, _asset(PAGE, site), site)


@router.api_route("/assets/{name:path}", methods=["GET", "HEAD"])
def read_asset(request: Request, name: str) -> Response:
    """Return a script, a style, a picture or an example scenario.

    A page of an earlier edition gets the present file, which it must not keep.
    """
    site = Site.of(request.app.state.settings)
    named, _, rest = name.partition("/")
    asset = find_asset(name, site) or find_asset(rest, site)
    if asset is None:
        raise NotFound(f"there is no asset {name}")
    return _sent(request, asset, site, keep=named == edition(site))


def _sent(request: Request, asset: Asset, site: Site, *, keep: bool = False) -> Response:
    headers = {
        "Content-Security-Policy": policy(site.tiles),
        "Cache-Control": "public, max-age=31536000, immutable" if keep else "no-cache",
        "Vary": "Accept-Encoding",
        "ETag": f'W/"{asset.etag}"',
    }
    if asset.etag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    if takes_gzip(request.headers.get("accept-encoding", "")):
        headers["Content-Encoding"] = "gzip"
        return Response(asset.compressed, headers=headers, media_type=asset.media_type)
    return Response(asset.content, headers=headers, media_type=asset.media_type)


def compressed(answer: Response, accept_encoding: str) -> Response:
    """Return an answer compressed, if its client takes that; fast, as each is sent once."""
    if takes_gzip(accept_encoding):
        answer.body = gzip.compress(answer.body, _FAST, mtime=0)
        answer.headers["Content-Encoding"] = "gzip"
        answer.headers["Content-Length"] = str(len(answer.body))
    answer.headers["Vary"] = "Accept-Encoding"
    return answer


def takes_gzip(accept_encoding: str) -> bool:
    """Whether the header names gzip without refusing it (q=0)."""
    for part in accept_encoding.lower().split(","):
        coding, _, weight = part.replace(" ", "").partition(";q=")
        if coding in ("gzip", "*"):
            return weight.strip("0.") != "" or weight == ""
    return False
