"""YAML 1.2, read by ruamel.yaml within limits, in time about proportional to its length.

The reader counts whatever may grow faster than the text: the depth of nesting, aliases, and the
keys that merges (<<) bring in, which double with each level that merges the previous one twice.
"""

import io
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, MaxDepthExceededError
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.nodes import MappingNode, SequenceNode
from ruamel.yaml.scanner import Scanner

DEEPEST = 100
"""Largest depth of nested collections; scenarios and plans need about ten."""
MOST_ALIASES = 3000
FEWEST_MERGED_KEYS = 10_000
"""Keys that merges may bring in, however short the text; a longer one may have one a character."""


class TooMuchYAMLError(MarkedYAMLError):
    """Raised for a text beyond a limit of this module; `problem` names the limit."""


def load_yaml(text: str) -> Any:
    """Return the value of a YAML 1.2 text; raises MarkedYAMLError, among others of ruamel.yaml."""
    yaml = _BoundedYAML(max(len(text), FEWEST_MERGED_KEYS))
    try:
        return yaml.load(io.StringIO(text))
    except MaxDepthExceededError as error:
        raise _too_deep(error.problem_mark) from None


class _BoundedYAML(YAML):
    """Safe reader that stops at the limits.

    Parameters
    ----------
    most_merged_keys : most keys that merges may bring in
    """

    def __init__(self, most_merged_keys: int) -> None:
        super().__init__(typ="safe", pure=True)
        self.most_merged_keys = most_merged_keys
        self.max_depth = DEEPEST + 1
        self.Scanner = _Scanner
        self.Composer = _Composer
        self.Constructor = _Constructor


def _too_deep(mark: Any) -> TooMuchYAMLError:
    return _too_much(f"nested more than {DEEPEST} deep", mark)


def _too_much(problem: str, mark: Any) -> TooMuchYAMLError:
    return TooMuchYAMLError(None, None, problem, mark)


class _Scanner(Scanner):
    """Scanner that refuses deep nesting at its opening bracket.

    Reading ahead is quadratic in the depth.
    """

    def fetch_flow_collection_start(self, TokenClass: Any, to_push: str) -> None:
        if len(self.flow_context) >= DEEPEST:
            raise _too_deep(self.reader.get_mark())
        super().fetch_flow_collection_start(TokenClass, to_push)


class _Composer(Composer):
    """Composer that counts aliases."""

    def __init__(self, loader: Any = None) -> None:
        super().__init__(loader=loader)
        self._aliases = 0

    def return_alias(self, a: Any) -> Any:
        self._aliases += 1
        if self._aliases > MOST_ALIASES:
            raise _too_much(f"more than {MOST_ALIASES} aliases; write values out", a.start_mark)
        return super().return_alias(a)


class _Constructor(SafeConstructor):
    """Constructor that counts the keys of merges before it copies them."""

    def __init__(self, preserve_quotes: bool | None = None, loader: Any = None) -> None:
        super().__init__(preserve_quotes=preserve_quotes, loader=loader)
        self._merged = 0

    def flatten_mapping(self, node: Any) -> Any:
        merges = [value for key, value in node.value if key.tag == "tag:yaml.org,2002:merge"]
        for value in merges:
            for one in value.value if isinstance(value, SequenceNode) else [value]:
                if isinstance(one, MappingNode):
                    self._merge(one, node)
        return super().flatten_mapping(node)

    def _merge(self, merged: Any, node: Any) -> None:
        """Flatten a merged mapping, so that it holds all keys that it brings in, and count them."""
        if merged is not node:
            self.flatten_mapping(merged)
        self._merged += len(merged.value)
        if self._merged > self.loader.most_merged_keys:
            raise _too_much(
                "merge keys (<<) bring in too many keys; write them out", node.start_mark
            )
