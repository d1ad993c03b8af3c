"""One stage of a refinement for `logdet` as NumPy arrays: what SciPy's solvers are given.

The same variables, weights and constraints as syncplan.refinement.nlp has, written for speed in
NumPy: all pairs and samples at once, landmarks among them as bodies that stand still and see
nothing. With v = (t_y, -t_x, t.g_a, t.g_b, 1) of a pair at a sample (notation of
syncplan.refinement.smooth_sightings), both rows of a mutual sighting are linear in v, so the
information of a pair comes from its 5 x 5 sums of w v v^T: one batched matrix product. A fixed
sparse matrix then adds all of them into the team's.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.special import expit, logsumexp

from syncplan.arrays import Array, Flags, Index
from syncplan.observability.referred_rows import NEAREST
from syncplan.refinement.constraints import CONTACT_SAMPLES
from syncplan.refinement.problem import RefineProblem, Stage, samples_of
from syncplan.refinement.smooth_team import sighted_bodies

__all__ = ["VectorisedTeam"]


_SHIFT = 1e-9
_CONTACT_WIDTH, _SAFETY_WIDTHS = 0.25, 3.0

# columns: v; rows: x, y, heading of a, then of b
_SEEN_BY_A = np.array(
    [
        [1, 0, 0, 0, 0],
        [0, 1, 0, 0, 0],
        [0, 0, -1, 0, -1],
        [-1, 0, 0, 0, 0],
        [0, -1, 0, 0, 0],
        [0, 0, 0, 1, 0],
    ],
    dtype=float,
)
_SEEN_BY_B = np.array(
    [
        [1, 0, 0, 0, 0],
        [0, 1, 0, 0, 0],
        [0, 0, -1, 0, 0],
        [-1, 0, 0, 0, 0],
        [0, -1, 0, 0, 0],
        [0, 0, 0, 1, -1],
    ],
    dtype=float,
)


@dataclass(frozen=True, slots=True)
class VectorisedTeam:
    """A problem at one stage; variables as those of syncplan.refinement.nlp, without extra ones.

    Attributes
    ----------
    free : (4 n,) which values of the circles, column by column, are variables
    fixed : (4 n,) the others' values, scaled
    lower, upper : bounds of the variables
    first, second : bodies of all pairs that may come into contact
    kept_first, kept_second : bodies of the pairs whose contact is kept
    turned : (2, k) cosine and sine of the angles turned at the samples
    contact_turned : (2, l) the same of the samples that contact is counted at
    shift : added to the information's diagonal
    weights : (k,) of each sample: how many it stands for, over the variance of a bearing
    counts : (l,) logarithm of how many each sample of contact stands for
    places : (m, 2) landmarks, scaled
    reach : range, scaled
    kept_reach : (c, 1) range less margin of the contacts kept, scaled
    kept_samples : (c,) logarithm of the samples they need
    gather : (9 n^2, 25 e) sparse, from the sums of each pair to the information
    """

    problem: RefineProblem
    stage: Stage
    free: Flags
    fixed: Array
    lower: Array
    upper: Array
    first: Index
    second: Index
    kept_first: Index
    kept_second: Index
    turned: Array
    contact_turned: Array
    shift: float
    weights: Array
    counts: Array
    places: Array
    reach: float
    kept_reach: Array
    kept_samples: Array
    gather: csr_array

    @classmethod
    def of(cls, problem: RefineProblem, stage: Stage) -> "VectorisedTeam":
        """Return the team of a problem at a stage. Raises ValueError for what is not needed here:
        limited views, sensors that differ, pairs that could come below the separation, areas."""
        sensors, scale = problem.sensors, problem.scale
        plain = (
            np.all(sensors.fields_of_view >= 2.0 * np.pi)
            and np.ptp(sensors.ranges) == np.ptp(sensors.bearing_sigmas) == 0.0
            and len(problem.guarded_pairs()) == 0
            and not problem.area.limited
            and problem.objective.name == "logdet"
        )
        if not plain:
            raise ValueError("written for logdet, equal sensors that see all round, free circles")
        times, contact = (
            samples_of(span, sensors, problem.orbits.rate, most)
            for span, most in (
                (problem.window, stage.samples),
                (problem.contact_span, min(stage.samples, CONTACT_SAMPLES)),
            )
        )
        first, second = sighted_bodies(problem).T
        unit = np.array([[scale], [scale], [scale], [1.0]])
        lower, upper = (problem.freedom.lower / unit, problem.freedom.upper / unit)
        free = problem.freedom.free.ravel(order="F")
        return cls(
            problem=problem,
            stage=stage,
            free=free,
            fixed=lower.ravel(order="F"),
            lower=lower.ravel(order="F")[free],
            upper=upper.ravel(order="F")[free],
            first=first,
            second=second,
            kept_first=problem.kept[:, 0],
            kept_second=problem.kept[:, 1],
            turned=np.array([np.cos(times.angles), np.sin(times.angles)]),
            contact_turned=np.array([np.cos(contact.angles), np.sin(contact.angles)]),
            shift=_SHIFT / sensors.bearing_sigmas[0] ** 2,
            weights=times.counts / sensors.bearing_sigmas[0] ** 2,
            counts=np.log(contact.counts),
            places=problem.landmarks / scale,
            reach=float(sensors.ranges[0]) / scale,
            kept_reach=_kept_reach(problem, stage)[:, None] / scale,
            kept_samples=np.log(problem.kept_samples),
            gather=_gather(problem.orbits.count, first, second),
        )

    def circles_of(self, variables: Array) -> Array:
        """Return the circles (4, n), scaled."""
        flat = self.fixed.copy()
        flat[self.free] = variables
        return flat.reshape(4, -1, order="F")

    def cost(self, variables: Array) -> float:
        """Return minus the mean logarithm of the information's eigenvalues."""
        circles = self.circles_of(variables)
        arms, spots = self._bodies(circles, self.turned)
        a, b = self.first, self.second
        q_x, q_y = spots[0, b] - spots[0, a], spots[1, b] - spots[1, a]
        squared = q_x * q_x + q_y * q_y
        step = 2.0 * self.stage.width * self.reach**2
        weight = self.weights * expit((self.reach**2 - squared) / step)
        scale = 1.0 / (squared + NEAREST**2)
        v = np.empty((len(a), 5, squared.shape[1]))
        v[:, 0], v[:, 1] = q_y * scale, -q_x * scale
        v[:, 2] = -v[:, 1] * arms[0, a] + v[:, 0] * arms[1, a]
        v[:, 3] = -v[:, 1] * arms[0, b] + v[:, 0] * arms[1, b]
        v[:, 4] = 1.0
        sums = (v * weight[:, None]) @ v.transpose(0, 2, 1)
        size = 3 * circles.shape[1]
        information = (self.gather @ sums.ravel()).reshape(size, size)
        information[np.diag_indices(size)] += self.shift
        return float(-np.linalg.slogdet(information)[1] / size)

    def room(self, variables: Array) -> Array:
        """Return (c,) the logarithm of samples in contact over those needed; at least 0 is met."""
        _, spots = self._bodies(self.circles_of(variables), self.contact_turned)
        q = spots[:, self.kept_second] - spots[:, self.kept_first]
        squared = q[0] ** 2 + q[1] ** 2
        reach = self.kept_reach**2
        x = (reach - squared) / (2.0 * _CONTACT_WIDTH * self.stage.width * reach)
        log = np.minimum(x, 0.0) - np.log1p(np.exp(-np.abs(x))) + self.counts
        return np.asarray(logsumexp(log, axis=1)) - self.kept_samples

    def _bodies(self, circles: Array, turned: Array) -> tuple[Array, Array]:
        """(2, n + m, k): the way gone since time 0, and where all bodies are, samples last."""
        arm = circles[2] * np.array([np.cos(circles[3]), np.sin(circles[3])])
        swing = self.problem.orbits.senses * np.array([-arm[1], arm[0]])
        arms = arm[..., None] * turned[0] + swing[..., None] * turned[1]
        still = np.broadcast_to(self.places.T[..., None], (2, len(self.places), arms.shape[2]))
        spots = np.concatenate([circles[:2, :, None] + arms, still], axis=1)
        gone = np.concatenate([arms - arm[..., None], np.zeros_like(still)], axis=1)
        return gone, spots


def _kept_reach(problem: RefineProblem, stage: Stage) -> Array:
    """(c,) m within which contacts are kept."""
    reach = float(problem.sensors.ranges[0])
    safety = _SAFETY_WIDTHS * _CONTACT_WIDTH * stage.width * reach if stage.last else 0.0
    return reach - problem.kept_margins - safety


def _gather(count: int, first: Index, second: Index) -> csr_array:
    """(9 n^2, 25 e): what each pair's sums of w v v^T add to the information, row by row."""
    mutual = np.kron(_SEEN_BY_A, _SEEN_BY_A) + np.kron(_SEEN_BY_B, _SEEN_BY_B)
    alone = np.kron(_SEEN_BY_A, _SEEN_BY_A)
    state = np.concatenate(
        [3 * first[:, None] + np.arange(3), 3 * second[:, None] + np.arange(3)], axis=1
    )
    row, column = np.repeat(state, 6, axis=1), np.tile(state, (1, 6))
    size = 3 * count
    value = np.where((second < count)[:, None, None], mutual, alone)
    inside = ((row < size) & (column < size))[..., None] & (value != 0.0)
    source = 25 * np.arange(len(first))[:, None, None] + np.arange(25)
    target = np.broadcast_to((row * size + column)[..., None], value.shape)
    source = np.broadcast_to(source, value.shape)
    return coo_array(
        (value[inside], (target[inside], source[inside])), shape=(size**2, 25 * len(first))
    ).tocsr()
