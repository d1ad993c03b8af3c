"""Second-order noise: what a sighting's curvature leaves unknown, as variance of the sighting.

A filter replaces a sighting by its tangent at the estimate. With the error of the relative position
split into a along and b across the line of sight, at distance rho, its next term is

    -a b / rho^2      of a bearing      variance  (P_aa P_bb + P_ab^2) / rho^4
    b^2 / (2 rho)     of a distance     variance  P_bb^2 / (2 rho^2)

for normal errors (Isserlis). Added to the variance of the sighting, it keeps a filter whose start
is uncertain from believing its first sightings too much. A compass is linear and has no such term.
The mean of the term is left out.

Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3.2 (second-order extended Kalman filter).
"""

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import COMPASS_KIND, DISTANCE_KIND
from syncplan.estimation.lane_filter import Lanes, inner

NEAREST_SQUARE = 1e-12
"""m^2: nearer bodies count as this far apart, which leaves finite variances."""


@inner
def second_order_variance(
    kind: int, dx: float, dy: float, xx: float, xy: float, yy: float
) -> float:
    """Return the variance of the second-order term, in the kind's unit squared.

    (dx, dy) is the relative position in m, xx, xy and yy are its covariance in m^2.
    """
    if kind == COMPASS_KIND:
        return 0.0
    square = max(dx * dx + dy * dy, NEAREST_SQUARE)
    if kind == DISTANCE_KIND:
        across = (dy * dy * xx - 2.0 * dx * dy * xy + dx * dx * yy) / square
        return across * across / (2.0 * square)
    mixed = (dx * dy * (yy - xx) + (dx * dx - dy * dy) * xy) / square
    # P_aa P_bb = det P + P_ab^2, whatever the axes
    return max(xx * yy - xy * xy + 2.0 * mixed * mixed, 0.0) / (square * square)


@inner
def second_order_lanes(
    kind: int,
    x: Array,
    P: Array,
    observer: int,
    target: int,
    landmarks: Array,
    variances: Array,
    lanes: Lanes,
) -> None:
    """Fill in the variance (lanes,) of a sighting's second-order term.

    x (n, 3, lanes) and the lower triangle of P (3n, 3n, lanes) are as before the sighting.
    """
    n, o, t = len(x), 3 * observer, 3 * target
    for lane in range(len(lanes)):
        xx, xy, yy = P[o, o, lane], P[o + 1, o, lane], P[o + 1, o + 1, lane]
        if target < n:
            dx, dy = x[target, 0, lane], x[target, 1, lane]
            xx += P[t, t, lane]
            xy += P[t + 1, t, lane]
            yy += P[t + 1, t + 1, lane]
            a, b = max(o, t), min(o, t)
            xx -= 2.0 * P[a, b, lane]
            xy -= P[a + 1, b, lane] + P[a, b + 1, lane]
            yy -= 2.0 * P[a + 1, b + 1, lane]
        else:
            dx, dy = landmarks[target - n, 0], landmarks[target - n, 1]
        dx -= x[observer, 0, lane]
        dy -= x[observer, 1, lane]
        variances[lane] = second_order_variance(kind, dx, dy, xx, xy, yy)
