"""Who is connected, and who was refused before the application."""

from api.connections import Connections
from api.metrics import Readings


class ConnectionReadings:
    """A source of the figures of this process's connections."""

    def __init__(self, connections: Connections) -> None:
        self._connections = connections

    def __call__(self) -> Readings:
        """Return how many there are now, and how many were refused."""
        refusals = dict(self._connections.refusals)
        return {
            "syncplan_connections": {(): self._connections.number},
            "syncplan_connections_refused": {
                (reason,): number for reason, number in refusals.items()
            },
        }
