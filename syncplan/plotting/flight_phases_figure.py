"""How far vehicles of a flight are ahead of the plan, or behind, beside what the plan allows."""

from syncplan.plotting.canvas import Spec
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.flight_panels import Curve, flight_panels_spec, series_in
from syncplan.plotting.palette import BLUE, ORANGE, VERMILLION
from syncplan.reports.flight_schemas import FlightDocument, FlownVehicle
from syncplan.reports.flight_series_schemas import VehicleOverTime


def flight_phases_spec(report: FlightDocument, style: FigureStyle) -> Spec:
    """Return the figure of phase errors over time, a panel a vehicle, with its tolerance.

    The tolerance is the least of a vehicle's links; a level shows the worst error of any trial in
    the second half. Raises InputError for a report without series.
    """
    series, vehicles = series_in(report), {one.name: one for one in report.vehicles}
    curves = {one.name: _curves(one, vehicles[one.name]) for one in series.vehicles}
    worst = {
        one.name: 0.0 if one.phase_error_s is None else one.phase_error_s.rms
        for one in report.vehicles
    }
    note = f"ahead of the plan or behind it, RMS over {report.run}; guidance {report.guidance}"
    words = "phase error over time", "s", note
    return flight_panels_spec(report, style, curves, worst, words)


def _curves(vehicle: VehicleOverTime, flown: FlownVehicle) -> list[Curve]:
    found = [Curve("phase", "phase error", {"color": BLUE, "width": 1.8}, vehicle.phase_rms_s)]
    if flown.phase_error_s is not None:
        line: Spec = {"color": ORANGE, "width": 1.8, "dash": "dash"}
        name = "worst of any trial, second half"
        found.append(Curve("worst", name, line, [flown.phase_error_s.worst]))
    if flown.phase_tolerance_s is not None:
        line = {"color": VERMILLION, "width": 2, "dash": "dot"}
        name = "the plan's tolerance"
        found.append(Curve("tolerance", name, line, [flown.phase_tolerance_s]))
    return found
