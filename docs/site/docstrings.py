"""How the reference reads our docstrings: what stands after a name's colon is its meaning.

NumPy's style has a type there; here types stand in the code, and the docstring says unit, shape and
meaning.
"""

from typing import Any

from griffe import Docstring, Extension, Module, Object

__all__ = ["Meanings"]

_NAMED = ("attributes", "parameters")


class Meanings(Extension):
    """Moves the words after a colon from the column of types to that of meanings."""

    def on_package(self, *, pkg: Module, **_: Any) -> None:
        """Mend every docstring of a package that has been read."""
        _mend_members(pkg)


def _mend_members(thing: Object) -> None:
    if thing.docstring is not None:
        _mend(thing.docstring, thing)
    for member in thing.members.values():
        if isinstance(member, Object):
            _mend_members(member)


def _mend(docstring: Docstring, thing: Object) -> None:
    for section in docstring.parsed:
        if section.kind.value not in _NAMED:
            continue
        for item in section.value:
            if item.description or item.annotation is None:
                continue
            item.description = str(item.annotation)
            item.annotation = _annotation(thing, item.name)


def _annotation(thing: Object, name: str) -> Any:
    """The type of an attribute, or of a parameter of the constructor, as the code has it."""
    if name in thing.members:
        return getattr(thing.members[name], "annotation", None)
    constructor = thing.members.get("__init__", thing)
    for parameter in getattr(constructor, "parameters", ()):
        if parameter.name == name:
            return parameter.annotation
    return None
