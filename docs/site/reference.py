"""The pages that are made from the code when the documentation is built."""

from collections.abc import Callable, Mapping

from docs.site.commands import commands_page
from docs.site.python_names import python_page
from docs.site.scenario_keys import keys_page
from docs.site.service_pages import operations_page, problems_page, settings_page
from docs.site.speed_page import speed_page

__all__ = ["PAGES"]

PAGES: Mapping[str, Callable[[], str]] = {
    "reference/command-line.md": commands_page,
    "reference/problems.md": problems_page,
    "reference/python.md": python_page,
    "reference/scenario.md": keys_page,
    "reference/service.md": operations_page,
    "reference/settings.md": settings_page,
    "speed.md": speed_page,
}
"""What writes each page, by its path in the documentation."""
