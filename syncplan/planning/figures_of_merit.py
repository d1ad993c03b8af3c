"""Figures of merit of a plan: what a refinement compares before and after."""

from dataclasses import dataclass

from syncplan.scenario.refine_options import Objective

__all__ = ["Figures"]


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of merit of one plan.

    Attributes
    ----------
    rank, certified : of the windowed matrix, and whether the certificate holds
    logdet, min_eigenvalue, trace : of the windowed information, positions in the refined plan's
        mean radius; logdet is -inf where unobservable
    window_bound : m, worst vehicle's; infinite where unobservable
    worst_predicted_rms, predicted_rms : m, posterior bound over the second half, worst vehicle and
        root mean square of all; NaN where not computed
    least_distance : m, the closest two vehicles come; infinite for one vehicle
    contact_margin : m, by which the link or landmark that is nearest to being lost stays within
        range for the samples it needs; infinite where none is to be kept
    """

    rank: int
    certified: bool
    logdet: float
    min_eigenvalue: float
    trace: float
    window_bound: float
    worst_predicted_rms: float
    predicted_rms: float
    least_distance: float
    contact_margin: float

    def cost(self, objective: Objective) -> float:
        """Return the figure that `objective` improves, smaller is better."""
        value = float(getattr(self, objective))
        falls = objective in ("worst_predicted_rms", "predicted_rms")
        return value if falls else -value
