"""How a job's trials are divided into batches: long enough to be worth it, enough for all cores."""

from collections.abc import Sequence
from itertools import pairwise

from api.job_kinds.job_tasks import Batch
from syncplan.estimation.trials import CHUNK_TRIALS

SHORTEST_S = 1.0


def batches_of(runs: Sequence[tuple[int, float]], batch_s: float, processes: int) -> list[Batch]:
    """Return the batches of runs given as (trials, seconds a trial takes).

    A batch takes about `batch_s`, or less where that leaves processes idle. The batches of a single
    run are as many for each process, so that none waits for another's last one. A batch begins at a
    multiple of CHUNK_TRIALS, so that no division changes a byte of the result.
    """
    total_s = sum(trials * seconds for trials, seconds in runs)
    aim_s = min(batch_s, max(total_s / processes, SHORTEST_S))
    batches = []
    for number, (trials, seconds) in enumerate(runs):
        chunks = -(-trials // CHUNK_TRIALS)
        count = max(round(trials * seconds / aim_s), 1)
        if len(runs) == 1 and count > 1:
            count = -(-count // processes) * processes
        count = min(count, chunks)
        # as even as whole chunks allow
        edges = [CHUNK_TRIALS * (chunks * k // count) for k in range(count)] + [trials]
        batches += [Batch(number, first, last - first) for first, last in pairwise(edges)]
    return batches
