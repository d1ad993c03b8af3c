"""The web page and its files: static, from this service alone, under a strict policy."""

from typing import Annotated

from fastapi import APIRouter, Header, Response

from api.assets import PAGE, Asset, find_asset
from api.problems import NotFound

router = APIRouter(include_in_schema=False)

# Plotly adds two style elements of its own; these are the digests of what it writes into them
_PLOTLY_STYLES = (
    "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='",
    "'sha256-ji27qzEtxXZW+7dun6UwjHXJ18e6WAin1VvNtkzIE/o='",
)

POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        f"style-src 'self' {' '.join(_PLOTLY_STYLES)}",
        "img-src 'self' data: blob:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
"""Content-Security-Policy: nothing from elsewhere, no script or style within the page."""

_HEADERS = {
    "Content-Security-Policy": POLICY,
    "Cache-Control": "no-cache",
    "Vary": "Accept-Encoding",
}

Conditions = Annotated[str, Header(alias="If-None-Match")]
Encodings = Annotated[str, Header(alias="Accept-Encoding")]


@router.api_route("/", methods=["GET", "HEAD"])
def read_page(if_none_match: Conditions = "", accept_encoding: Encodings = "") -> Response:
    """The page."""
    page = find_asset(PAGE)
    assert page is not None
    return _sent(page, if_none_match, accept_encoding)


@router.api_route("/assets/{name:path}", methods=["GET", "HEAD"])
def read_asset(
    name: str, if_none_match: Conditions = "", accept_encoding: Encodings = ""
) -> Response:
    """A script, a style, a picture or an example scenario."""
    found = find_asset(name)
    if found is None:
        raise NotFound(f"there is no asset {name}")
    return _sent(found, if_none_match, accept_encoding)


def _sent(asset: Asset, if_none_match: str, accept_encoding: str) -> Response:
    headers = {**_HEADERS, "ETag": f'W/"{asset.etag}"'}
    if asset.etag in if_none_match:
        return Response(status_code=304, headers=headers)
    if _takes_gzip(accept_encoding):
        headers["Content-Encoding"] = "gzip"
        return Response(asset.compressed, headers=headers, media_type=asset.media_type)
    return Response(asset.content, headers=headers, media_type=asset.media_type)


def _takes_gzip(accept_encoding: str) -> bool:
    """Whether the header names gzip, and not to refuse it (q=0)."""
    for part in accept_encoding.lower().split(","):
        coding, _, weight = part.replace(" ", "").partition(";q=")
        if coding in ("gzip", "*"):
            return weight.strip("0.") != "" or weight == ""
    return False
