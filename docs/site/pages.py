"""The source of the site: pages with their figures put in, generated pages, scripts."""

import html
import re
import shutil
from pathlib import Path

from docs.site.figures import DRAWN
from docs.site.kind_tables import with_tables
from docs.site.reference import PAGES
from syncplan.errors import InputError
from syncplan.plotting.canvas import CONFIG, Spec
from syncplan.plotting.figure_files import embedded
from syncplan.plotting.figure_style import DARK
from syncplan.plotting.vendored import plotly_script

__all__ = ["DOCS", "with_figures", "write_pages"]

DOCS = Path(__file__).parents[1]
"""The folder of the pages written by hand."""

_PLOTLY = "assets/plotly.min.js"
_FIGURES = "assets/figures.js"
_LEFT_OUT = {"__init__.py", "__pycache__", "site"}
_NOT_RUN = re.compile(r'^(```+)(\w+) (data-not-run="[^"]*")$', re.MULTILINE)
"""The first line of a block that is not run; MkDocs wants such an attribute in braces."""
_PLACE = re.compile(r"^<!-- figure: ([\w-]+) -->$", re.MULTILINE)


def write_pages(folder: Path) -> None:
    """Write everything that a generator of sites needs into a folder, which is emptied first.

    Raises InputError for a figure or table that is not there.
    """
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(DOCS, folder, ignore=lambda _, names: _LEFT_OUT & set(names))
    for path in sorted(folder.rglob("*.md")):
        name = path.relative_to(folder).as_posix()
        markdown = _NOT_RUN.sub(r"\1{ .\2 \3 }", path.read_text("utf-8"))
        path.write_text(with_figures(with_tables(markdown, name), name), "utf-8")
    for name, content in PAGES.items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(content(), "utf-8")
    (folder / _PLOTLY).write_text(plotly_script(), "utf-8")


def with_figures(markdown: str, name: str) -> str:
    """Return a page with figures where `<!-- figure: NAME -->` stands, and the scripts they need.

    Raises InputError for a figure that is not there.
    """
    drawn = _PLACE.sub(lambda found: _figure(found[1], name), markdown)
    if drawn == markdown:
        return drawn
    settings = embedded("plot-settings", {"config": dict(CONFIG), "dark": dict(DARK)})
    up = "../" * name.count("/")
    scripts = "\n".join(f'<script defer src="{up}{one}"></script>' for one in (_PLOTLY, _FIGURES))
    return f"{drawn}\n\n{settings}\n{scripts}\n"


def _figure(name: str, page: str) -> str:
    if name not in DRAWN:
        raise InputError(f"no figure {name!r}; there are {', '.join(DRAWN)}", source=page)
    drawn = DRAWN[name]()
    words = html.escape(drawn.words)
    title = html.escape(_title(drawn.spec))
    # a group, not an image: it holds buttons
    spoken = f'role="group" aria-label="{title}" aria-describedby="words-{name}"'
    return (
        f'<figure class="drawn" id="{name}">\n<div class="plot" id="plot-{name}" {spoken}></div>\n'
        f'<figcaption id="words-{name}">{words}</figcaption>\n</figure>\n'
        f"{embedded(f'plot-{name}-values', drawn.spec)}\n"
    )


def _title(spec: Spec) -> str:
    return str(spec["layout"]["title"]["text"])
