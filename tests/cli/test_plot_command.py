"""The command that draws, and the page and images it writes."""

import asyncio
import base64
import hashlib
import html
import importlib.util
import io
import json
import logging
import re
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from syncplan import figures
from syncplan.errors import InputError
from syncplan.plotting.figure_files import figure_page
from syncplan.plotting.figure_style import COLUMN_PX, SHEET_PX, FigureStyle
from syncplan.plotting.figures import specs_of
from syncplan.plotting.printed_report import report_page
from syncplan.plotting.vendored import FONT_NAME, font, plotly_script
from tests.tools.image_browser import BROWSER, needs_browser
from tests.tools.on_paper import plan
from tests.tools.processes import PATIENCE_S
from tests.tools.scenarios import FILES, document, example, small
from tests.tools.serving import ROOT

GRID = str(FILES / "paper-grid-alternate.yaml")

PAPERS = b"rgb(255, 255, 255)", b"rgb(22, 22, 26)"
LARGEST_PAGE = 2_000_000
"""Most bytes of a page of one plan."""

Run = Callable[..., tuple[int, str, str]]


def _values(page: str) -> dict[str, Any]:
    """Values of the figures of a page, by name."""
    parts = re.findall(r'<script[^>]* id="values-([^"]+)"[^>]*>(.*?)</script', page, re.DOTALL)
    return {name: json.loads(values) for name, values in parts}


def test_a_page_holds_all_figures_and_fetches_nothing(run: Run, tmp_path: Path) -> None:
    target = tmp_path / "plan.html"
    status, out, err = run("plot", GRID, "-o", str(target))
    assert (status, out) == (0, "")
    assert f"wrote {target}" in err
    text = target.read_text(encoding="utf-8")
    page = _values(text)
    assert list(page) == ["formation", "animation", "timeline", "spectrum", "prediction"]
    assert page == json.loads(json.dumps(specs_of(plan(example("paper-grid-alternate")))))
    tags = re.sub(r"(<script[^>]*>).*?</script", r"\1", text, flags=re.DOTALL)
    assert not re.search(r"<link|\s(?:src|srcset|data)\s*=", tags)
    assert re.findall(r'<a [^>]*href="([^"]*)"', tags) == [f"#{name}" for name in page]
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', tags)
    assert html.unescape(policy).startswith("default-src 'none'")
    assert "connect-src" not in policy
    before, after = text[: text.index("<style>")], text[text.index("<style>") :]
    style = after[: after.index("</style>")]
    assert "http:" not in before + style
    assert "https:" not in before + style
    assert "url(" not in style
    assert "@import" not in style
    assert text.count("* plotly.js (basic - minified) v") == 1
    assert len(text.encode()) < LARGEST_PAGE
    # the toolbar offers no upload
    assert '"showSendToCloud":false' in text
    for values in page.values():
        assert values["layout"]["modebar"]["remove"] == ["sendChartToCloud"]
    assert [path.name for path in tmp_path.iterdir()] == ["plan.html"]


def test_a_report_is_written_whatever_the_verdict(run: Run, tmp_path: Path) -> None:
    target = tmp_path / "report.html"
    status, out, said = run("report", GRID, "-o", str(target))
    assert (status, out) == (0, "")
    assert said.splitlines() == [
        "syncplan: NO-GO: 2 reasons: unobservable",
        f"syncplan: wrote {target}",
    ]
    made = plan(example("paper-grid-alternate"))
    assert target.read_text("utf-8") == report_page(made, identifier=Path(GRID).name)
    assert run("report", GRID)[1] == target.read_text("utf-8")


def test_what_is_vendored_is_what_was_fetched_and_what_plotly_itself_has() -> None:
    from plotly.offline import get_plotlyjs_version

    folder = files("syncplan.plotting.vendored")
    for line in folder.joinpath("SHA256SUMS").read_text("utf-8").splitlines():
        digest, name = line.split()
        assert hashlib.sha256(folder.joinpath(name).read_bytes()).hexdigest() == digest, name
    locked = json.loads((ROOT / "vendor/package-lock.json").read_text("utf-8"))["packages"]
    for version in (
        locked["node_modules/plotly.js-basic-dist-min"]["version"],
        get_plotlyjs_version(),
    ):
        assert f"plotly.js (basic - minified) v{version}\n" in plotly_script()


def test_the_bundle_of_a_page_draws_every_trace() -> None:
    for spec in specs_of(plan(example("paper-grid-alternate"))).values():
        assert {trace["type"] for trace in spec["data"]} <= {"scatter", "bar"}


def test_names_in_a_page_can_break_out_of_nothing(run: Run, written: Any) -> None:
    odd = "</script><script>alert(1)</script>"
    source = written(name=odd, formation={"centers_m": {odd: [0, 0], "b": [70, 0]}})
    _, out, _ = run("plot", source)
    assert odd not in out
    assert "<script>alert" not in out


def test_values_in_a_page_end_no_script() -> None:
    spec = specs_of(plan(small()), ["formation"])["formation"]
    spec["layout"]["title"]["text"] = "</script><!--"
    text = figure_page("<title>", {"formation": spec})
    assert "</script><!--" not in text
    assert _values(text)["formation"] == json.loads(json.dumps(spec))
    assert "<title>&lt;title&gt;</title>" in text


def test_standard_input_is_read_for_a_dash(printed: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    given = io.TextIOWrapper(io.BytesIO(json.dumps(document()).encode()))
    monkeypatch.setattr(sys, "stdin", given)
    asked = ("--figure", "formation", "--figure", "spectrum")
    assert list(_values(printed("plot", "-", *asked))) == ["formation", "spectrum"]


def test_reports_and_sweeps_are_known_by_what_they_hold(
    run: Run, refused: Any, tmp_path: Path
) -> None:
    report, swept = str(tmp_path / "report.json"), str(tmp_path / "sweep.json")
    short = ("--trials", "3", "--duration", "3")
    assert run("validate", GRID, *short, "--series", "-o", report)[0] == 0
    flight = str(tmp_path / "flight.json")
    held = ("--duration", "40", "--series", "--hold", "v2@5:2")
    same = str(FILES / "paper-grid-same.yaml")
    assert run("fly", same, "--trials", "2", *held, "-o", flight)[0] == 0
    figures = ["tracks", "tracking", "phases", "separation", "meetings", "events"]
    assert list(_values(run("plot", flight)[1])) == figures
    assert run("sweep", GRID, "--angular-rate", "0.2,0.4", *short, "-o", swept)[0] == 0
    assert list(_values(run("plot", report)[1])) == ["accuracy", "errors", "consistency"]
    assert list(_values(run("plot", swept)[1])) == ["sweep"]
    err = refused("plot", report, "--figure", "formation")
    assert "--figure: 'formation': this file has no such figure; choose from accuracy" in err
    assert run("plot", report, "--compare", GRID)[0] == 2


def test_at_a_terminal_a_file_is_asked_for(refused: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    assert "--output: give the file to write, such as -o figures.html" in refused("plot", GRID)


def test_a_damaged_report_is_refused_by_file_and_key(
    run: Run, refused: Any, tmp_path: Path
) -> None:
    report = tmp_path / "report.json"
    assert run("validate", GRID, "--trials", "2", "--duration", "2", "-o", str(report))[0] == 0
    values = json.loads(report.read_text())
    values["vehicles"][1]["rms_m"] = "much"
    report.write_text(json.dumps(values))
    assert f"{report}: vehicles[1].rms_m" in refused("plot", str(report))
    report.write_text(json.dumps({"swept": "orbit.radius_m", "rows": []}))
    assert f"{report}: rows" in refused("plot", str(report))


@pytest.mark.parametrize("missing", ["plotly", "kaleido"])
def test_a_missing_extra_is_named(
    refused: Any, missing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name == missing else real(name)
    )
    # None in sys.modules makes an import fail as if nothing were installed
    for name in {missing, *(n for n in sys.modules if n.startswith(f"{missing}."))}:
        monkeypatch.setitem(sys.modules, name, None)
    target = tmp_path / "plan.png"
    err = refused("plot", GRID, "-o", str(target))
    assert f"needs {missing}: pip install 'syncplan[plot]'" in err
    assert not target.exists()
    if missing == "plotly":
        with pytest.raises(InputError, match="needs plotly"):
            figures.formation(plan(small()))


def test_without_a_browser_the_remedy_is_named(
    refused: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BROWSER_PATH", str(tmp_path / "none"))
    target = tmp_path / "plan.svg"
    err = refused("plot", GRID, "-o", str(target))
    assert "needs Chrome or Chromium" in err
    assert err.count("\n") == 1
    assert not target.exists()


@needs_browser
@pytest.mark.parametrize(
    ("ending", "theme", "start"),
    [("svg", "light", b"<svg"), ("svg", "dark", b"<svg"), ("pdf", "light", b"%PDF-")],
)
@pytest.mark.long
def test_images_are_what_their_names_and_themes_say_and_the_same_each_time(
    run: Run, ending: str, theme: str, start: bytes, tmp_path: Path
) -> None:
    one, two = tmp_path / f"one.{ending}", tmp_path / f"two.{ending}"
    for target in (one, two):
        asked = ("--figure", "formation", "--theme", theme)
        assert run("plot", GRID, *asked, "-o", str(target))[0] == 0
    content = one.read_bytes()
    assert content == two.read_bytes()
    assert content.startswith(start)
    if ending == "svg":
        assert b"v1" in content
        assert base64.b64encode(font()) in content
        assert set(re.findall(rb"font-family: (\w+)", content)) == {FONT_NAME.encode()}
        # laid out in it too: "landmark link, rank 2, certified" at 12 px, and the line before it
        entry = re.search(rb'class="legendtoggle"[^>]* width="([\d.]+)"', content)
        assert entry is not None
        assert float(entry[1]) == pytest.approx(201.9, abs=0.5)
        assert b"NOT observable" in content
        assert [paper in content for paper in PAPERS] == [theme == "light", theme == "dark"]


@needs_browser
def test_several_images_need_one_browser_and_are_of_the_size_asked_for(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import kaleido

    started = []
    start = kaleido.Kaleido

    def counted(**options: Any) -> Any:
        started.append(options)
        return start(**options)

    monkeypatch.setattr(kaleido, "Kaleido", counted)
    names = ("formation", "spectrum", "timeline")
    asked = [part for name in names for part in ("--figure", name)]
    size = ("--height", "700", "--pixel-ratio", "1.5")
    status, _, err = run("plot", GRID, *asked, *size, "-o", str(tmp_path / "plan.png"))
    assert status == 0
    assert len(started) == 1
    files = [tmp_path / f"plan-{name}.png" for name in names]
    assert sorted(tmp_path.iterdir()) == sorted(files)
    assert [f"wrote {file}" in err for file in files] == [True] * 3
    for file in files:
        content = file.read_bytes()
        assert content.startswith(b"\x89PNG\r\n")
        assert [int.from_bytes(content[k : k + 4], "big") for k in (16, 20)] == [1500, 1050]
    assert len({file.read_bytes() for file in files}) == 3


@pytest.mark.parametrize(("problem", "limit_s"), [("gone", 90.0), ("TimeoutError", 0.05)])
def test_a_browser_that_fails_or_never_answers_is_given_up_in_one_line(
    run: Run,
    problem: str,
    limit_s: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    import kaleido

    class Broken:
        async def __aenter__(self) -> None:
            if problem == "TimeoutError":
                await asyncio.Event().wait()
            logging.getLogger("choreographer.channels.pipe").error("a message that is no JSON")
            raise RuntimeError(problem)

        async def __aexit__(self, *_: object) -> None:
            """Never called."""

    monkeypatch.setattr(kaleido, "Kaleido", lambda **_: Broken())
    monkeypatch.setattr("syncplan.plotting.figure_files._TIMEOUT_S", limit_s)
    status, _, err = run("plot", GRID, "-o", str(tmp_path / "plan.png"))
    assert status == 1
    assert f"could not draw the image: {problem}" in err
    assert not caplog.records
    assert not list(tmp_path.iterdir())


def test_none_of_several_images_is_written_over_what_they_are_made_from(
    refused: Any, tmp_path: Path
) -> None:
    source = tmp_path / "plan-spectrum.svg"
    source.write_text(json.dumps(document()))
    asked = ("--figure", "formation", "--figure", "spectrum", "-o", str(tmp_path / "plan.svg"))
    assert "is the file that is read" in refused("plot", str(source), *asked)
    assert list(tmp_path.iterdir()) == [source]


def test_a_page_takes_a_theme_and_a_width(run: Run) -> None:
    _, plain, _ = run("plot", GRID)
    _, dark, _ = run("plot", GRID, "--theme", "dark", "--width", "700")
    assert '<html lang="en">' in plain
    assert '<html lang="en" data-theme="dark">' in dark
    assert '<meta name="color-scheme" content="dark">' in dark
    assert "body { max-width: 748px; }" in dark
    assert "max-width: 748px" not in plain
    # the script swaps light colours: they stand in the page, whatever the theme
    values = _values(dark)["formation"]
    assert values["layout"]["font"]["color"] == "#1b1b1f"
    # as wide as the reader's window
    assert "width" not in values["layout"]


def test_a_page_leaves_out_what_it_is_asked_to(run: Run) -> None:
    _, out, _ = run("plot", GRID, "--no-title", "--no-subtitle", "--no-legend")
    for name, values in _values(out).items():
        assert values["layout"]["title"]["text"] == "", name
        assert values["layout"]["showlegend"] is False
    assert "NOT observable: rank" not in out


@needs_browser
@pytest.mark.long
def test_a_narrow_page_shows_figures_laid_out_for_a_column(run: Run, tmp_path: Path) -> None:
    target = tmp_path / "plan.html"
    assert run("plot", GRID, "--figure", "formation", "-o", str(target))[0] == 0
    made = plan(example("paper-grid-alternate"))
    for window, style in ((760, FigureStyle(width=SHEET_PX)), (500, FigureStyle(width=COLUMN_PX))):
        height = specs_of(made, ["formation"], style=style)["formation"]["layout"]["height"]
        dom = _dumped(target, tmp_path, f"--window-size={window},900")
        drawn = re.search(r'class="main-svg"[^>]* height="(\d+)"', dom)
        assert drawn is not None
        assert int(drawn[1]) == height


@needs_browser
@pytest.mark.long
def test_a_browser_draws_the_page_and_plays_it_without_a_fault(run: Run, tmp_path: Path) -> None:
    target = tmp_path / "plan.html"
    assert run("plot", GRID, "-o", str(target))[0] == 0
    page = target.read_text(encoding="utf-8")
    play = (
        "let steps = 0; new MutationObserver(() => { document.body.dataset.steps = ++steps; })"
        ".observe(document.querySelector('.player output'), { childList: true });"
        "document.querySelector('.player button').click()"
    )
    page, _, end = page.rpartition("</body>")
    target.write_text(f"{page}<script>{play}</script></body>{end}", encoding="utf-8")
    dom = _dumped(target, tmp_path)
    assert dom.count('class="main-svg"') >= 5
    assert dom.count('class="player"') == 1
    assert dom.index('id="about-animation"') < dom.index('class="player"')
    assert dom.index('class="player"') < dom.index('id="plot-animation"')
    assert ">Pause</button>" in dom
    steps = re.search(r'data-steps="(\d+)"', dom)
    assert steps is not None
    assert int(steps[1]) >= 3


@needs_browser
@pytest.mark.long
def test_a_printed_page_fills_its_sheets(run: Run, tmp_path: Path) -> None:
    target = tmp_path / "plan.html"
    assert run("plot", GRID, "-o", str(target))[0] == 0
    printed = tmp_path / "plan.pdf"
    _dumped(target, tmp_path, f"--print-to-pdf={printed}")
    sheets = re.findall(rb"/Type\s*/Page\b", printed.read_bytes())
    assert len(sheets) == 3


def _dumped(page: Path, work: Path, *more: str) -> str:
    """A page's elements once its script has run, without a fault."""
    assert BROWSER is not None
    how = ("--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={work / 'profile'}")
    seen = ("--enable-logging=stderr", "--virtual-time-budget=6000", "--dump-dom")
    done = subprocess.run(
        [BROWSER, *how, *seen, *more, page.as_uri()],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=True,
    )
    assert "CONSOLE" not in done.stderr, done.stderr
    return done.stdout
