"""Graphs of the team: colourings, cycles, trees and drawings."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from syncplan.arrays import Array

Edge = tuple[int, int]

_LARGEST_ENERGY_DRAWING = 120
"""Most vertices that Kamada-Kawai, cubic in their number, draws."""


def two_colouring(count: int, edges: Iterable[Edge]) -> list[int] | None:
    """Return a colour 0 or 1 per vertex with no edge inside a colour, or None if there is none.

    The first vertex of every component has colour 0.
    """
    edges = list(edges)
    colour = [depth % 2 for depth in _rooted(count, edges)[1]]
    return None if any(colour[a] == colour[b] for a, b in edges) else colour


def odd_cycle(count: int, edges: Iterable[Edge]) -> list[int]:
    """Return the vertices of an odd cycle in order, or an empty list if the graph is bipartite."""
    edges = list(edges)
    parent, depth, root = _rooted(count, edges)
    odd = [(root[a], min(a, b), k) for k, (a, b) in enumerate(edges) if depth[a] == depth[b]]
    if not odd:
        return []
    a, b = sorted(edges[min(odd)[-1]])
    up, down = [a], [b]
    while a != b:
        a, b = parent[a], parent[b]
        up.append(a)
        down.append(b)
    return [*reversed(up), *down[:-1]]


def components(count: int, edges: Iterable[Edge]) -> list[list[int]]:
    """Return the connected components as sorted lists, ordered by their first vertex."""
    parts: dict[int, list[int]] = {}
    for vertex, root in enumerate(_rooted(count, list(edges))[2]):
        parts.setdefault(root, []).append(vertex)
    return list(parts.values())


def blocks(count: int, edges: Sequence[Edge]) -> list[list[int]]:
    """Return the positions in `edges` of each biconnected block; a bridge is one by itself.

    Choices within a block do not restrict another: blocks share single vertices. Each vertex stands
    for the edge to its parent in a forest. An edge outside it closes a cycle, whose edges are
    merged.
    """
    parent, depth, _ = _rooted(count, edges)
    position = {(min(a, b), max(a, b)): k for k, (a, b) in enumerate(edges)}
    merged = DisjointSets(count)
    top = list(range(count))
    for a, b in position:
        cycle = []
        while a != b:
            a, b = (a, b) if depth[a] > depth[b] else (b, a)
            cycle.append(merged[a])
            a = parent[top[merged[a]]]
        highest = min((top[k] for k in cycle), key=depth.__getitem__)
        for k in cycle:
            merged.union(cycle[0], k)
        top[merged[cycle[0]]] = highest
    parts: dict[int, list[int]] = {}
    for pair, k in position.items():
        parts.setdefault(merged[max(pair, key=depth.__getitem__)], []).append(k)
    return sorted(sorted(part) for part in parts.values())


def spanning_forest(count: int, edges: Sequence[Edge], weights: Sequence[float]) -> list[int]:
    """Return the positions in `edges` of a spanning forest of least total weight.

    Among equal weights, edges of the first vertices come first.
    """
    lightest: dict[Edge, int] = {}
    for k, (a, b) in enumerate(edges):
        pair = min(a, b), max(a, b)
        if weights[k] < weights[lightest.setdefault(pair, k)]:
            lightest[pair] = k
    merged = DisjointSets(count)
    order = sorted(lightest.items(), key=lambda item: (weights[item[1]], item[0][0]))
    return sorted(k for (a, b), k in order if merged.union(a, b))


def traversal(count: int, edges: Sequence[Edge]) -> list[tuple[int, int, int]]:
    """Return (parent, child, position in `edges`) breadth first, from each component's first."""
    near: list[dict[int, int]] = [{} for _ in range(count)]
    for k, (a, b) in enumerate(edges):
        near[a][b] = near[b][a] = k
    seen = [False] * count
    found = []
    for root in range(count):
        queue = [] if seen[root] else [root]
        seen[root] = True
        for parent in queue:
            for child, k in near[parent].items():
                if not seen[child]:
                    seen[child] = True
                    queue.append(child)
                    found.append((parent, child, k))
    return found


def _rooted(count: int, edges: Sequence[Edge]) -> tuple[list[int], list[int], list[int]]:
    """Parent, depth and root of each vertex in `traversal`; a root is its own parent."""
    parent, depth, first = list(range(count)), [0] * count, list(range(count))
    for above, child, _ in traversal(count, edges):
        parent[child], depth[child], first[child] = above, depth[above] + 1, first[above]
    return parent, depth, first


def bottleneck(lengths: Array) -> float:
    """Return the longest edge of a shortest spanning tree, from (n, n) lengths.

    It is the least range that connects all vertices; 0 for a single vertex. Infinite lengths are no
    edges.
    """
    a, b = np.triu_indices(len(lengths), 1)
    usable = np.isfinite(lengths[a, b])
    known = lengths[a, b][usable].tolist()
    edges = list(zip(a[usable].tolist(), b[usable].tolist(), strict=True))
    return max((known[k] for k in spanning_forest(len(lengths), edges, known)), default=0.0)


class DisjointSets:
    """Union-find over vertices 0 to count - 1."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))

    def __getitem__(self, vertex: int) -> int:
        """Return the vertex that stands for the set."""
        parent = self._parent
        while parent[vertex] != vertex:
            parent[vertex] = vertex = parent[parent[vertex]]
        return vertex

    def union(self, a: int, b: int) -> bool:
        """Merge two sets; returns whether they were apart."""
        a, b = self[a], self[b]
        self._parent[b] = a
        return a != b


def contraction(count: int, same: Iterable[Edge]) -> list[int]:
    """Return the class number of each vertex after the pairs in `same` are merged."""
    label = [0] * count
    for number, part in enumerate(components(count, same)):
        for vertex in part:
            label[vertex] = number
    return label


def drawings(count: int, edges: Iterable[Edge], amount: int, seed: int) -> Iterator[Array]:
    """Yield `amount` drawings (count, 2) of a connected graph, without unit, most promising first.

    In order: Kamada-Kawai, the same from a planar drawing if there is one, spectral, then springs
    from random places. Each is perturbed slightly, so that no two vertices coincide.
    """
    import networkx as nx

    generator = np.random.default_rng(seed)
    if count <= 2:
        yield from [np.arange(count)[:, None] * np.array([[1.0, 0.0]])] * amount
        return
    graph = nx.empty_graph(count)
    graph.add_edges_from(edges)
    makers: list[Callable[[], Any]] = [lambda: nx.spectral_layout(graph)]
    if count <= _LARGEST_ENERGY_DRAWING:
        makers.insert(0, lambda: nx.kamada_kawai_layout(graph))
        planar, embedding = nx.check_planarity(graph)
        if planar:
            flat = nx.combinatorial_embedding_to_pos(embedding)
            makers.insert(1, lambda: nx.kamada_kawai_layout(graph, pos=flat))
    for number in range(amount):
        drawn = (
            makers[number]()
            if number < len(makers)
            else nx.spring_layout(graph, seed=int(generator.integers(2**31)))
        )
        places = np.array([drawn[k] for k in range(count)], dtype=float)
        places /= max(float(np.ptp(places, axis=0).max()), 1e-12)
        yield places + 0.01 / np.sqrt(count) * generator.standard_normal((count, 2))
