"""python -m docs.site: build the documentation into build/site, from build/docs."""

import os
import subprocess
import sys

from docs.site.pages import DOCS, write_pages
from syncplan.errors import InputError

CONFIG = DOCS / "site" / "mkdocs.yml"
SOURCE = DOCS.parent / "build" / "docs"


def main() -> int:
    """Write the pages and let MkDocs build them strictly; return its exit status."""
    write_pages(SOURCE)
    # its page about MkDocs 2.0 is no warning about this site
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONWARNINGS": "ignore"}
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "-f", str(CONFIG)]
    status = subprocess.run(command, env=environment, cwd=DOCS.parent).returncode
    if status == 0:
        print("wrote build/site/index.html")
    return status


if __name__ == "__main__":
    try:
        sys.exit(main())
    except InputError as error:
        sys.exit(f"docs: {error}")
