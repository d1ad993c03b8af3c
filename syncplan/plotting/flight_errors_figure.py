"""How far vehicles of a flight are off the plan, and off their estimates, beside the prediction."""

from syncplan.plotting.canvas import Spec
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.flight_panels import Curve, flight_panels_spec, series_in
from syncplan.plotting.palette import GREEN, INK, ORANGE, SKY, VERMILLION
from syncplan.reports.flight_schemas import FlightDocument
from syncplan.reports.flight_series_schemas import VehicleOverTime


def flight_errors_spec(report: FlightDocument, style: FigureStyle) -> Spec:
    """Return the figure of tracking and estimation errors over time, a panel a vehicle.

    The bound is that along the paths flown, the level the plan's own prediction for the second
    half. Raises InputError for a report without series.
    """
    predicted = {
        one.name: None if one.errors is None else one.errors.predicted_rms_m
        for one in report.vehicles
    }
    series = series_in(report)
    curves = {one.name: _curves(one, predicted.get(one.name)) for one in series.vehicles}
    worst = {
        one.name: 0.0 if one.errors is None else one.errors.tracking_rms_m
        for one in report.vehicles
    }
    note = f"RMS over {report.run}; guidance {report.guidance}"
    words = "errors over time", "m", note
    return flight_panels_spec(report, style, curves, worst, words)


def _curves(vehicle: VehicleOverTime, predicted: float | None) -> list[Curve]:
    sigma = Curve("sigma", "filter's own sigma", {"color": SKY, "width": 5}, vehicle.sigma_m)
    bound: Spec = {"color": VERMILLION, "width": 2, "dash": "dot"}
    tracking: Spec = {"color": GREEN, "width": 1.8, "dash": "dash"}
    found = [
        sigma,
        Curve("bound", "bound along the path", bound, vehicle.bound_m),
        Curve("tracking", "distance from the plan", tracking, vehicle.tracking_rms_m),
        Curve("error", "error of the estimate", {"color": INK, "width": 1.3}, vehicle.rms_m),
    ]
    if predicted:
        level: Spec = {"color": ORANGE, "width": 1.5, "dash": "longdash"}
        found.append(Curve("predicted", "the plan's prediction", level, [predicted]))
    return found
