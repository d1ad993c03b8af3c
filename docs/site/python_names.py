"""The public names of the library as a page; their words are the docstrings."""

import inspect

import syncplan
from syncplan import figures
from syncplan.exporting import formats

__all__ = ["python_page"]

_INTRODUCTION = """# Python

The package exports everything a program needs; figures and exports are modules of their own.
Notation, units and shapes are those of `syncplan/__init__.py`: SI units and radians, NumPy arrays.
Names that are not on this page are not public and may move.
"""

_SECTIONS = (
    ("## The package", syncplan, "syncplan"),
    ("## Figures", figures, "syncplan.plotting.figures"),
    ("## Exports", formats, "syncplan.exporting.formats"),
)


def python_page() -> str:
    """Return the page: a directive of mkdocstrings for each public name."""
    parts = [_INTRODUCTION]
    shown: list[object] = []
    for title, module, name in _SECTIONS:
        parts.append(f"{title}\n")
        if module is not syncplan:
            parts.append(f"{inspect.getdoc(module)}\n".replace("\n    ", "\n\n    ", 1))
        for public in module.__all__:
            thing = getattr(module, public)
            # exports has names of the package as well; figures has a section of its own
            if not inspect.ismodule(thing) and not any(thing is one for one in shown):
                shown.append(thing)
                parts.append(f"::: {name}.{public}\n")
    return "\n".join(parts)
