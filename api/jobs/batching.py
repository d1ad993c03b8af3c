"""How the trials of a job are cut into parts: long enough to be worth it, enough for all cores."""

from collections.abc import Sequence
from itertools import pairwise

from api.computing.tasks import Cut
from syncplan.estimation.trials import CHUNK_TRIALS

__all__ = ["cuts_of"]

SHORTEST_S = 1.0


def cuts_of(runs: Sequence[tuple[int, float]], part_s: float, processes: int) -> list[Cut]:
    """Return the parts of runs given as (trials, seconds a trial takes).

    A part takes about `part_s`, or less where that leaves processes idle: those of a single run are
    as many for each process, or the last one would be waited for. A part begins at a multiple of
    CHUNK_TRIALS, so that no cut changes a byte of the result.
    """
    total_s = sum(trials * seconds for trials, seconds in runs)
    aim_s = min(part_s, max(total_s / processes, SHORTEST_S))
    cuts = []
    for number, (trials, seconds) in enumerate(runs):
        chunks = -(-trials // CHUNK_TRIALS)
        count = max(round(trials * seconds / aim_s), 1)
        if len(runs) == 1 and count > 1:
            count = -(-count // processes) * processes
        count = min(count, chunks)
        # as even as whole chunks allow
        edges = [CHUNK_TRIALS * (chunks * k // count) for k in range(count)] + [trials]
        cuts += [Cut(number, first, last - first) for first, last in pairwise(edges)]
    return cuts
