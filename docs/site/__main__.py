"""python -m docs.site: build the documentation into build/site, from build/docs.

With --write, renew the tables that stand in the pages instead.
"""

import os
import subprocess
import sys
from pathlib import Path

from docs.site.kind_tables import renew
from docs.site.pages import DOCS, write_pages
from syncplan.errors import InputError

CONFIG = DOCS / "site" / "mkdocs.yml"
SOURCE = DOCS.parent / "build" / "docs"


def main() -> int:
    """Write the pages and let MkDocs build them strictly; return its exit status."""
    write_pages(SOURCE)
    status = generate(CONFIG)
    if status == 0:
        print("wrote build/site/index.html")
    return status


def generate(config: Path) -> int:
    """Return MkDocs' exit status over a configuration: 1 if there was any warning."""
    # a banner about MkDocs 2.0 is no warning about this site
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONWARNINGS": "ignore"}
    # not --quiet, with which warnings are neither shown nor counted
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(config)]
    return subprocess.run(command, env=environment, cwd=DOCS.parent).returncode


if __name__ == "__main__":
    try:
        if "--write" in sys.argv[1:]:
            renew(DOCS)
        else:
            sys.exit(main())
    except InputError as error:
        sys.exit(f"docs: {error}")
