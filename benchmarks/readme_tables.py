"""Tables between markers of README.md."""

import os
import platform
from pathlib import Path

__all__ = ["README", "machine", "markdown", "write_between"]

README = Path(__file__).with_name("README.md")


def machine() -> str:
    """Return the machine in general terms."""
    return f"{os.cpu_count()} cores, Python {platform.python_version()}"


def markdown(rows: list[list[str]], rule: list[str]) -> str:
    """Return a table of Markdown: its head first, and the line below it."""
    header = "|" + "|".join(rule) + "|"
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], header, *lines[1:]])


def write_between(begin: str, end: str, block: str, readme: Path) -> None:
    """Put a block between two lines of `readme`. Raises ValueError where they are missing."""
    text = readme.read_text(encoding="utf-8")
    before, found, rest = text.partition(begin)
    _, ended, after = rest.partition(end)
    if not found or not ended:
        raise ValueError(f"{readme.name}: the table goes between the lines {begin} and {end}")
    readme.write_text(f"{before}{begin}\n\n{block}\n\n{end}{after}", encoding="utf-8")
