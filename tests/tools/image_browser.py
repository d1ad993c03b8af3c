"""The browser that draws images, where one is installed."""

import os
import shutil

import pytest

__all__ = ["BROWSER", "needs_browser"]

BROWSER = os.environ.get("BROWSER_PATH") or next(
    (found for name in ("chromium", "google-chrome", "chrome") if (found := shutil.which(name))),
    None,
)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chrome or Chromium")
