"""Relative position measurement graphs (RPMG): who sees whom, at an instant or over a while."""

import networkx as nx
import numpy as np

from syncplan.orbits.contacts import Windows


def union_over(windows: Windows, period: float, start: float, length: float) -> nx.DiGraph:
    """Return the union of the RPMG over [start, start + length] s as a directed networkx graph.

    The relative position measurement graph has an edge i -> j where i sees j; nodes from the number
    of vehicles on are landmarks. A length of 0 gives the graph at that instant.
    """
    pair = np.repeat(np.arange(len(windows.observers)), np.diff(windows.first))
    span = windows.ends - windows.starts
    since = (start - windows.starts) % period
    met = (since <= span) | (since + length >= period) | (span >= period)
    graph = nx.DiGraph()
    graph.add_nodes_from(int(k) for k in np.union1d(windows.observers, windows.targets))
    chosen = pair[met]
    graph.add_edges_from(
        zip(windows.observers[chosen].tolist(), windows.targets[chosen].tolist(), strict=True)
    )
    return graph
