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
    import networkx as nx

    graph = _graph(count, edges)
    if not nx.is_bipartite(graph):
        return None
    colour = [0] * count
    for component in nx.connected_components(graph):
        root = min(component)
        for vertex, depth in nx.single_source_shortest_path_length(graph, root).items():
            colour[vertex] = depth % 2
    return colour


def odd_cycle(count: int, edges: Iterable[Edge]) -> list[int]:
    """Return the vertices of an odd cycle in order, or an empty list if the graph is bipartite."""
    import networkx as nx

    graph = _graph(count, edges)
    for component in nx.connected_components(graph):
        root = min(component)
        tree = nx.bfs_tree(graph, root)
        depth = nx.single_source_shortest_path_length(graph, root)
        for a, b in graph.subgraph(component).edges:
            if (depth[a] - depth[b]) % 2 == 0:
                to_a = nx.shortest_path(tree, root, a)
                to_b = nx.shortest_path(tree, root, b)
                shared = sum(1 for x, y in zip(to_a, to_b, strict=False) if x == y)
                return [*to_a[shared - 1 :], *reversed(to_b[shared:])]
    return []


def components(count: int, edges: Iterable[Edge]) -> list[list[int]]:
    """Return the connected components as sorted lists, ordered by their first vertex."""
    import networkx as nx

    return sorted(sorted(part) for part in nx.connected_components(_graph(count, edges)))


def blocks(count: int, edges: Sequence[Edge]) -> list[list[int]]:
    """Return the positions in `edges` of each biconnected block; a bridge is one by itself.

    Choices within a block do not restrict another: blocks share single vertices.
    """
    import networkx as nx

    position = {(min(a, b), max(a, b)): k for k, (a, b) in enumerate(edges)}
    parts = nx.biconnected_component_edges(_graph(count, edges))
    return sorted(sorted(position[min(a, b), max(a, b)] for a, b in part) for part in parts)


def spanning_forest(count: int, edges: Sequence[Edge], weights: Sequence[float]) -> list[int]:
    """Return the positions in `edges` of a spanning forest of least total weight."""
    import networkx as nx

    graph = nx.Graph()
    graph.add_nodes_from(range(count))
    for k, (a, b) in enumerate(edges):
        if not graph.has_edge(a, b) or weights[k] < graph[a][b]["weight"]:
            graph.add_edge(a, b, weight=weights[k], position=k)
    return sorted(data["position"] for _, _, data in nx.minimum_spanning_edges(graph, data=True))


def traversal(count: int, edges: Sequence[Edge]) -> list[tuple[int, int, int]]:
    """Return (parent, child, position in `edges`) breadth first, from each component's first."""
    import networkx as nx

    graph = _graph(count, ((a, b, {"position": k}) for k, (a, b) in enumerate(edges)))
    return [
        (parent, child, graph[parent][child]["position"])
        for root in sorted(min(part) for part in nx.connected_components(graph))
        for parent, child in nx.bfs_edges(graph, root)
    ]


def bottleneck(lengths: Array) -> float:
    """Return the longest edge of a shortest spanning tree, from (n, n) lengths.

    It is the least range that connects all vertices; 0 for a single vertex. Infinite lengths are no
    edges.
    """
    import networkx as nx

    a, b = np.triu_indices(len(lengths), 1)
    usable = np.isfinite(lengths[a, b])
    known = zip(a[usable].tolist(), b[usable].tolist(), lengths[a, b][usable].tolist(), strict=True)
    graph = _graph(len(lengths), ((a, b, {"weight": length}) for a, b, length in known))
    tree = nx.minimum_spanning_edges(graph, data=True)
    return max((float(data["weight"]) for *_, data in tree), default=0.0)


def disjoint_sets(count: int) -> Any:
    """Return a union-find structure over `count` vertices: `sets[a]`, `sets.union(a, b)`."""
    import networkx as nx

    return nx.utils.UnionFind(range(count))


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
    graph = _graph(count, edges)
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


def _graph(count: int, edges: Iterable[Edge | tuple[int, int, dict[str, Any]]]) -> Any:
    """Undirected graph of edges, each of which may have attributes."""
    import networkx as nx

    graph = nx.Graph()
    graph.add_nodes_from(range(count))
    graph.add_edges_from(edges)
    return graph
