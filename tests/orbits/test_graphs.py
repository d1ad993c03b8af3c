"""Graphs of the team, against networkx."""

import networkx as nx
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from syncplan.orbits.graphs import (
    DisjointSets,
    Edge,
    blocks,
    bottleneck,
    components,
    odd_cycle,
    spanning_forest,
    traversal,
    two_colouring,
)


def _drawn(seed: int) -> tuple[int, list[Edge], list[float], nx.Graph]:
    """Vertices, edges either way round, some twice, and weights with many equal ones."""
    generator = np.random.default_rng(seed)
    count = int(generator.integers(1, 24))
    ends = generator.integers(0, count, (int(generator.integers(0, 3 * count)), 2)).tolist()
    edges = [(a, b) for a, b in ends if a != b]
    weights = generator.integers(0, 4, len(edges)).astype(float).tolist()
    graph = nx.empty_graph(count)
    for k, (a, b) in enumerate(edges):
        if not graph.has_edge(a, b) or weights[k] < graph[a][b]["weight"]:
            graph.add_edge(a, b, weight=weights[k], lightest=k)
        graph[a][b]["position"] = k
    return count, edges, weights, graph


@given(st.integers(0, 2**32 - 1))
def test_graphs_of_a_team_are_those_of_networkx_ties_and_order_included(seed: int) -> None:
    count, edges, weights, graph = _drawn(seed)
    parts = sorted(sorted(part) for part in nx.connected_components(graph))
    assert components(count, edges) == parts
    assert traversal(count, edges) == [
        (a, b, graph[a][b]["position"]) for part in parts for a, b in nx.bfs_edges(graph, part[0])
    ]
    tree = list(nx.minimum_spanning_edges(graph, data=True))
    assert spanning_forest(count, edges, weights) == sorted(of["lightest"] for *_, of in tree)
    assert blocks(count, edges) == sorted(
        sorted(graph[a][b]["position"] for a, b in part)
        for part in nx.biconnected_component_edges(graph)
    )
    lengths = nx.to_numpy_array(graph, weight="weight", nonedge=np.inf)
    assert bottleneck(lengths) == max((of["weight"] for *_, of in tree), default=0.0)


@given(st.integers(0, 2**32 - 1))
def test_a_graph_has_the_colours_or_the_odd_cycle_of_its_breadth_first_trees(seed: int) -> None:
    count, edges, _, graph = _drawn(seed)
    roots = [min(part) for part in nx.connected_components(graph)]
    depth = {
        vertex: length
        for root in roots
        for vertex, length in nx.single_source_shortest_path_length(graph, root).items()
    }
    colour, cycle = two_colouring(count, edges), odd_cycle(count, edges)
    assert (colour is not None) == (not cycle) == nx.is_bipartite(graph)
    if colour is not None:
        assert colour == [depth[vertex] % 2 for vertex in range(count)]
        return
    a, b = next(
        (a, b)
        for root in sorted(roots)
        for a, b in graph.edges
        if nx.has_path(graph, root, a) and depth[a] == depth[b]
    )
    assert len(cycle) % 2 == 1
    assert nx.is_simple_path(graph, cycle)
    assert graph.has_edge(cycle[0], cycle[-1])
    assert cycle[len(cycle) // 2 : len(cycle) // 2 + 2] == [a, b]


@given(st.integers(0, 2**32 - 1))
def test_disjoint_sets_are_the_components_of_what_was_merged(seed: int) -> None:
    count, edges, _, graph = _drawn(seed)
    merged = DisjointSets(count)
    apart = [merged.union(a, b) for a, b in edges]
    assert sum(apart) == count - nx.number_connected_components(graph)
    for a, b in np.ndindex(count, count):
        assert (merged[a] == merged[b]) == nx.has_path(graph, a, b)
