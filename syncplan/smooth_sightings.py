"""Sightings of one pair as smooth functions of its two circles, for derivatives.

A sighting is counted with a weight between 0 and 1 instead of yes or no: a logistic step in the
distance (and, for limited views, in the angle off boresight) of stated width, which the solver
narrows from stage to stage. Samples stand at the times of the sensor's own; where a window holds
more of them than can be afforded, neighbours in the turn are counted together.

With t = q / |q|^2 and each vehicle's way gone since time 0, g, the two rows of a mutual sighting
differ in the headings alone (see syncplan.observability), so a pair's information over all samples
comes to ten sums:

    c = (t_y, -t_x)       row of a seeing b:   ( c, -t.g_a - 1,   -c, t.g_b     )
                          row of b seeing a:   ( c, -t.g_a,       -c, t.g_b - 1 )
    sums: c c^T (3), c h_a (2), c h_b (2), h_a h_a, h_b h_b, h_a h_b
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ANCHOR_SUMS",
    "PAIR_SUMS",
    "SampleTimes",
    "anchor_function",
    "pair_function",
    "sample_times",
]

Array = NDArray[np.float64]

PAIR_SUMS = 10
ANCHOR_SUMS = 6
"""A landmark has no heading: c c^T (3), c h (2), h h."""

_NEAREST_SQUARED = 1e-6
"""As NEAREST in syncplan.observability, squared: keeps bearings from turning infinitely fast."""

_ROUNDED_ANGLE = 1e-6


@dataclass(frozen=True, slots=True)
class SampleTimes:
    """The samples of a window, neighbours in the turn taken together where there are many.

    Attributes
    ----------
    angles : (k,) rad turned since time 0
    counts : (k,) samples that each stands for
    """

    angles: Array
    counts: Array

    @property
    def spacing(self) -> float:
        """Typical angle in rad between neighbours."""
        return float(2.0 * np.pi / max(len(self.angles), 1))


def sample_times(window: float, sample_time: float, rate: float, most: int) -> SampleTimes:
    """Return the samples k Ts in [0, window) s as at most `most` angles turned at `rate` rad/s."""
    number = int(np.ceil(window / sample_time - 1e-9))
    turned = np.sort(np.arange(number) * (rate * sample_time) % (2.0 * np.pi))
    if number <= most:
        return SampleTimes(turned, np.ones(number))
    group = np.minimum((turned / (2.0 * np.pi) * most).astype(int), most - 1)
    counts = np.bincount(group, minlength=most).astype(float)
    angles = np.bincount(group, weights=turned, minlength=most)
    held = counts > 0.0
    return SampleTimes(angles[held] / counts[held], counts[held])


def pair_function(times: SampleTimes, views: bool, each: bool) -> ca.Function:
    """Return the function (a, b, parameters, widths) -> (information, log contact).

    `a`, `b` are circles (x, y, R, phi) in units of the scale. Parameters are the senses of a and
    b, the ranges (scaled), the inverse variances of their bearings, and with `views` the half
    views and boresights in rad of both, after the shares that either way of seeing has in the
    contact. Widths are those of the step (a share of the range) for information, then for
    contact; the third is how much of the range (scaled) contact is to leave. Information is the
    ten sums, (10, 1) over all samples or, with `each`, (10, k). Log contact is the logarithm of
    the number of samples in contact.
    """
    a, b = ca.SX.sym("a", 4), ca.SX.sym("b", 4)
    parameters = ca.SX.sym("parameters", 12 if views else 8)
    widths = ca.SX.sym("widths", 3)
    sense_a, sense_b, range_a, range_b, inverse_a, inverse_b, ways_a, ways_b = ca.vertsplit(
        parameters[:8]
    )
    arm_a, arm_b = _arms(a, sense_a, times), _arms(b, sense_b, times)
    count = len(times.angles)
    gone_a = arm_a - ca.repmat(_arm(a), 1, count)
    gone_b = arm_b - ca.repmat(_arm(b), 1, count)
    q = ca.repmat(b[:2] - a[:2], 1, count) + arm_b - arm_a
    squared = ca.sum1(q * q)
    view_a = view_b = None
    if views:
        view_a = _view(arm_a, sense_a, q, parameters[8], parameters[10])
        view_b = _view(arm_b, sense_b, -q, parameters[9], parameters[11])
    counts = ca.DM(times.counts).T
    weight_a = inverse_a * counts * ca.exp(_log_weight(squared, range_a, view_a, widths[0]))
    weight_b = inverse_b * counts * ca.exp(_log_weight(squared, range_b, view_b, widths[0]))
    t = q / ca.repmat(squared + _NEAREST_SQUARED, 2, 1)
    c_x, c_y = t[1, :], -t[0, :]
    along_a, along_b = ca.sum1(t * gone_a), ca.sum1(t * gone_b)
    both = weight_a + weight_b
    sums = ca.vertcat(
        both * c_x * c_x,
        both * c_x * c_y,
        both * c_y * c_y,
        -c_x * (both * along_a + weight_a),
        -c_y * (both * along_a + weight_a),
        c_x * (both * along_b - weight_b),
        c_y * (both * along_b - weight_b),
        weight_a * (along_a + 1.0) ** 2 + weight_b * along_a**2,
        weight_a * along_b**2 + weight_b * (along_b - 1.0) ** 2,
        -weight_a * (along_a + 1.0) * along_b - weight_b * along_a * (along_b - 1.0),
    )
    one = _log_count(squared, range_a - widths[2], view_a, widths[1], times)
    other = _log_count(squared, range_b - widths[2], view_b, widths[1], times)
    contact = ca.logsumexp(ca.vertcat(one + ca.log(ways_a), other + ca.log(ways_b)))
    return ca.Function(
        "pair", [a, b, parameters, widths], [sums if each else ca.sum2(sums), contact]
    )


def anchor_function(times: SampleTimes, views: bool, each: bool) -> ca.Function:
    """Return the function (a, place, parameters, widths) -> (information, log contact).

    As `pair_function` for a landmark at `place` (2,); parameters are a's sense, range and inverse
    variance, and with `views` its half view and boresight.
    """
    a, place = ca.SX.sym("a", 4), ca.SX.sym("place", 2)
    parameters = ca.SX.sym("parameters", 5 if views else 3)
    widths = ca.SX.sym("widths", 3)
    sense, reach, inverse = ca.vertsplit(parameters[:3])
    arm = _arms(a, sense, times)
    count = len(times.angles)
    q = ca.repmat(place - a[:2], 1, count) - arm
    squared = ca.sum1(q * q)
    view = _view(arm, sense, q, parameters[3], parameters[4]) if views else None
    counts = ca.DM(times.counts).T
    weight = inverse * counts * ca.exp(_log_weight(squared, reach, view, widths[0]))
    t = q / ca.repmat(squared + _NEAREST_SQUARED, 2, 1)
    c_x, c_y = t[1, :], -t[0, :]
    turned = -ca.sum1(t * (arm - ca.repmat(_arm(a), 1, count))) - 1.0
    sums = ca.vertcat(
        weight * c_x * c_x,
        weight * c_x * c_y,
        weight * c_y * c_y,
        weight * c_x * turned,
        weight * c_y * turned,
        weight * turned**2,
    )
    contact = _log_count(squared, reach - widths[2], view, widths[1], times)
    return ca.Function(
        "anchor", [a, place, parameters, widths], [sums if each else ca.sum2(sums), contact]
    )


def _arm(circle: ca.SX) -> ca.SX:
    return circle[2] * ca.vertcat(ca.cos(circle[3]), ca.sin(circle[3]))


def _arms(circle: ca.SX, sense: ca.SX, times: SampleTimes) -> ca.SX:
    """(2, k) from the centre to the vehicle at each sample."""
    arm = _arm(circle)
    swing = sense * ca.vertcat(-arm[1], arm[0])
    return arm @ ca.DM(np.cos(times.angles)).T + swing @ ca.DM(np.sin(times.angles)).T


def _view(arms: ca.SX, sense: ca.SX, q: ca.SX, half: ca.SX, boresight: ca.SX) -> ca.SX:
    """(1, k) rad left between the sight of q and the edge of the view; negative outside it."""
    ahead = sense * ca.vertcat(-arms[1, :], arms[0, :])
    cos, sin = ca.cos(boresight), ca.sin(boresight)
    axis = ca.vertcat(cos * ahead[0, :] - sin * ahead[1, :], sin * ahead[0, :] + cos * ahead[1, :])
    off = ca.atan2(
        axis[0, :] * q[1, :] - axis[1, :] * q[0, :], axis[0, :] * q[0, :] + axis[1, :] * q[1, :]
    )
    return half - ca.sqrt(off**2 + _ROUNDED_ANGLE)


def _log_weight(squared: ca.SX, reach: ca.SX, view: ca.SX | None, width: ca.SX) -> ca.SX:
    """Logarithm of the weight of a sighting; the view's step is as wide as the range's share."""
    log = _log_logistic((reach**2 - squared) / (2.0 * width * reach**2))
    return log if view is None else log + _log_logistic(view / width)


def _log_count(
    squared: ca.SX, reach: ca.SX, view: ca.SX | None, width: ca.SX, times: SampleTimes
) -> ca.SX:
    """Logarithm of the number of samples in contact: steep even far from contact."""
    log = _log_weight(squared, reach, view, width) + ca.DM(np.log(times.counts)).T
    return ca.logsumexp(log.T)


def _log_logistic(x: ca.SX) -> ca.SX:
    return ca.fmin(x, 0.0) - ca.log1p(ca.exp(-ca.fabs(x)))
