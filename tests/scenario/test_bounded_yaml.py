"""YAML that would take long to read is refused at once; what takes its due time is read as ever."""

import time
from functools import cache
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from syncplan.errors import InputError
from syncplan.scenario.loading import parse_document, parse_values


def merging(levels: int, width: int) -> str:
    """Mappings that each merge the one before several times."""
    lines = ["a0: &a0 {x: 1}"]
    for level in range(1, levels):
        lines += [f"a{level}: &a{level}", f"  <<: [{', '.join([f'*a{level - 1}'] * width)}]"]
    return "\n".join(lines)


SLOW = {
    "merges of merges, twice each": (merging(25, 2), "merge keys"),
    "merges of merges, eight times each": (merging(9, 8), "merge keys"),
    "aliases without end": ("a: &a [" + "*a," * 300_000, "aliases"),
    "lists without end": ("a: " + "[" * 100_000, "nested more than 100 deep"),
    "mappings without end": ("{a: " * 50_000, "nested more than 100 deep"),
    "lists and mappings without end": ("[{" * 50_000, "nested more than 100 deep"),
    "lists of lists": ("- " * 50_000, "nested more than 100 deep"),
    "keys of keys": ("? " * 50_000, "nested more than 100 deep"),
    "a merge of itself": ("a: &a {<<: &b {<<: *a, x: 1}}", "nested too deeply"),
}


@cache
def usual() -> float:
    """Processor time in s that a thousand lines take."""
    began = time.process_time()
    parse_document("\n".join(f"k{k}: [1, 2, 3, 4, 5]" for k in range(1000)), "")
    return time.process_time() - began


@pytest.mark.parametrize(("text", "problem"), SLOW.values(), ids=SLOW)
def test_what_would_take_long_is_refused_sooner_than_a_thousand_lines_are_read(
    text: str, problem: str
) -> None:
    began = time.process_time()
    with pytest.raises(InputError, match=problem) as caught:
        parse_document(text, "team.yaml")
    assert time.process_time() - began < usual()
    assert str(caught.value).startswith("team.yaml: ")
    assert "\n" not in str(caught.value)


def test_a_merge_within_the_limits_is_read_as_the_parser_alone_reads_it() -> None:
    text = merging(8, 3) + "\nb: {<<: [*a1, *a7], x: 2, y: [*a3]}\nc: {<<: *a2}\n"
    assert parse_document(text, "") == YAML(typ="safe", pure=True).load(text)


def test_nesting_and_aliases_up_to_the_limits_are_read() -> None:
    assert parse_values("[" * 100 + "]" * 100, "") is not None
    assert len(parse_document("a: &a 1\nb: [" + "*a, " * 3000 + "]", "")["b"]) == 3000


KEYS = st.sampled_from(["a", "b", "c"])
VALUES = st.recursive(
    st.integers(-9, 9) | KEYS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=20,
)


@given(
    st.dictionaries(KEYS, VALUES, min_size=1, max_size=3),
    st.lists(st.tuples(st.integers(0, 3), st.dictionaries(KEYS, VALUES, max_size=2)), max_size=5),
)
def test_documents_with_anchors_and_merges_are_read_as_the_parser_alone_reads_them(
    first: dict[str, Any], others: list[tuple[int, dict[str, Any]]]
) -> None:
    lines = [f"m0: &m0 {first}"]
    for number, (merged, own) in enumerate(others, 1):
        pairs = "".join(f", {key}: {value}" for key, value in own.items())
        lines.append(f"m{number}: &m{number} {{<<: *m{min(merged, number - 1)}{pairs}}}")
    text = "\n".join(lines)
    assert parse_document(text, "") == YAML(typ="safe", pure=True).load(text)
