"""One of several HTTP processes: the application on a shared socket, linked to the supervisor."""

import contextlib
import itertools
import logging
import os
import queue
import signal
import socket
import threading
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection

from api.connections import ConnectionTable, Place
from api.logs import configure_logs
from api.main import create_app
from api.metrics import Collected, Metrics, merged
from api.problems import Unavailable
from api.server import serve_until_told
from api.settings import divided
from api.supervisor import Enrolment
from syncplan.runtime.child_processes import connect_to_parent

_PATIENCE_S = 5.0


class SupervisorLink:
    """A process's connection to the supervisor.

    supervisor: sample n -> this process: sampled (n, metrics)
    this process: scrape n -> supervisor: scraped (n, metrics of every process)
    """

    def __init__(self, connection: Connection, metrics: Metrics) -> None:
        self._connection = connection
        self._metrics = metrics
        self._sending = threading.Lock()
        self._scraping = threading.Lock()
        self._numbers = itertools.count()
        self._scraped: queue.SimpleQueue[tuple[int, list[Collected]]] = queue.SimpleQueue()
        # reading may wait for the database, and the supervisor does not wait for who reads
        self._sampler = ThreadPoolExecutor(1, thread_name_prefix="sampler")
        threading.Thread(target=self._listen, daemon=True, name="supervisor").start()

    def ready(self) -> None:
        """Let the supervisor know that requests are answered."""
        self._send("ready", None)

    def gather(self) -> Collected:
        """Return the metrics of all processes as those of one; raises Unavailable."""
        with self._scraping:
            number = next(self._numbers)
            self._send("scrape", number)
            with contextlib.suppress(queue.Empty):
                while True:
                    answered, samples = self._scraped.get(timeout=_PATIENCE_S)
                    if answered == number:
                        return merged(samples)
        raise Unavailable("the metrics of the other processes did not come; try again")

    def _listen(self) -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                kind, value = self._connection.recv()
                if kind == "sample":
                    self._sampler.submit(self._sample, value)
                else:
                    self._scraped.put(value)
        # there is no supervisor any more
        os.kill(os.getpid(), signal.SIGTERM)

    def _sample(self, number: int) -> None:
        self._send("sampled", (number, self._metrics.own()))

    def _send(self, kind: str, value: object) -> None:
        with self._sending, contextlib.suppress(OSError):
            self._connection.send((kind, value))


def serve(descriptor: int) -> None:
    """Serve until the supervisor ends this process or itself: the process's main function."""
    connection = connect_to_parent(descriptor)
    given: Enrolment = connection.recv()
    configure_logs(given.settings.log_level)
    app = create_app(divided(given.settings, given.share), given.share)
    link = SupervisorLink(connection, app.state.metrics)
    app.state.metrics.gather = link.gather
    place = Place(ConnectionTable(given.table, given.share.count), given.share.number, link.ready)
    with socket.socket(fileno=given.listening) as listening:
        started = serve_until_told(app, listening, place)
    logging.shutdown()
    # threads may wait for a database that is away
    os._exit(0 if started else 1)
