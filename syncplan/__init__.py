"""syncplan: synchronised circular orbits that let a team of robots localise itself.

Given a scenario (circles, sensors, a few known landmarks), syncplan finds phases at which
neighbours meet once a turn, decides whether all their sightings together make every position and
heading observable, bounds the error of any unbiased filter, and checks the bound with a Monte
Carlo of an extended Kalman filter.

    import syncplan
    scenario = syncplan.load_scenario("examples/scenarios/paper-grid-same.yaml")
    plan = syncplan.plan(scenario)
    report = syncplan.validate(plan, trials=200, seed=1)
    print(plan.observable, report.accuracy.late_position, report.predicted)

Notation
--------
SI units and radians; x east, y north, angles from +x counter-clockwise. Words in signatures,
symbols in bodies:

    n, m       number of vehicles, of landmarks; bodies from n on are landmarks
    c, R       centers (n, 2) m, radii (n,) m
    d          senses (n,), +1 counter-clockwise, -1 clockwise
    omega      rate, rad/s, common to all; T = 2 pi / omega the period; tau = omega t
    phi        phases (n,) rad; phi_i(t) = phi_i + d_i omega t
    psi        headings, phi + d pi / 2 (the paper writes psi for both)
    theta      time-phases d phi
    D, beta    distance and bearing from one centre to another
    q          position of a target relative to its observer
    Ts         sample time; sightings fall at k Ts
    P          covariance of the error of (x, y, psi) of all vehicles
    Phi        transition of errors from one time to another

Packages, each using only those before it; each lists its modules
-----------------------------------------------------------------
    arrays            types of arrays
    errors            the errors raised on purpose
    phrases           wording of lists and shares
    terms             terms and their meanings
    options           options of runs, each declared once
    runtime           cores and threads, child processes, files written whole
    results           results as files, data frames and HTML
    recordings        recordings of real robots, read and checked
    scenario          scenarios, read and checked
    documents         common parts of all JSON documents
    orbits            circles, contact windows, least distances, sightings
    synchronisation   senses and phases
    importing         places from files of the field
    placement         centres, from links or from a gap
    observability     rank, certificate, unobservable modes
    estimation        bounds, the filter, Monte Carlo, replays
    guidance          the closed loop of filter, commands and true motion
    planning          plan, judge, validate, sweep
    refinement        the best plan near a plan
    landmarks         choice of landmark sites
    flight            flights of a plan; the navigator on board
    designs           the cheapest formation for a brief
    reports           JSON documents
    plotting          figures
    studies           studies by name: commands, jobs and the client follow from them
    exporting         formats of other programs
    client            the library, computed by a service
    cli               the command line

References
----------
"Observability Conditions for Switching Sensing Topology for Cooperative Localization" (the paper);
Diaz-Banez et al., "A general framework for synchronizing a team of robots under communication
constraints", IEEE Transactions on Robotics, 2017. docs/theory.md names the source of each formula.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__all__ = [
    "Brief",
    "Client",
    "Design",
    "Flight",
    "InputError",
    "Navigator",
    "NoGoError",
    "NoSolutionError",
    "Plan",
    "Replay",
    "Scenario",
    "SyncplanError",
    "Validation",
    "WhatIf",
    "choose_landmarks",
    "design",
    "export",
    "figures",
    "fly",
    "import_places",
    "load_log",
    "load_plan",
    "load_scenario",
    "place",
    "plan",
    "refine",
    "replay",
    "report_page",
    "sweep",
    "validate",
    "what_if",
]

__version__ = "0.1.0"

_HOME = {
    "load_plan": "planning.plan_files",
    "choose_landmarks": "landmarks.site_choice",
    "design": "designs.designer",
    "Brief": "scenario.brief",
    "Design": "designs.designer",
    "Client": "client.service_client",
    "Flight": "flight.flying",
    "InputError": "errors",
    "Navigator": "flight.navigator",
    "NoGoError": "errors",
    "NoSolutionError": "errors",
    "Plan": "planning.plans",
    "Replay": "estimation.replay_results",
    "Scenario": "scenario.specification",
    "SyncplanError": "errors",
    "Validation": "planning.validation",
    "WhatIf": "planning.loss_study",
    "export": "exporting.formats",
    "fly": "flight.flying",
    "import_places": "importing.imported_places",
    "load_log": "recordings.recording_formats",
    "load_scenario": "scenario.loading",
    "place": "placement.centers",
    "plan": "planning.planner",
    "refine": "refinement.refiner",
    "replay": "estimation.replays",
    "report_page": "plotting.printed_report",
    "sweep": "planning.variations",
    "validate": "planning.validation",
    "what_if": "planning.loss_study",
}
_MODULES = {"figures": "plotting.figures"}

if TYPE_CHECKING:
    from syncplan.client.service_client import Client
    from syncplan.designs.designer import Design, design
    from syncplan.errors import InputError, NoGoError, NoSolutionError, SyncplanError
    from syncplan.estimation.replay_results import Replay
    from syncplan.estimation.replays import replay
    from syncplan.exporting.formats import export
    from syncplan.flight.flying import fly
    from syncplan.flight.navigator import Navigator
    from syncplan.importing.imported_places import import_places
    from syncplan.landmarks.site_choice import choose_landmarks
    from syncplan.placement.centers import place
    from syncplan.planning.loss_study import WhatIf, what_if
    from syncplan.planning.plan_files import load_plan
    from syncplan.planning.plan_flights import Flight
    from syncplan.planning.planner import plan
    from syncplan.planning.plans import Plan
    from syncplan.planning.validation import Validation, validate
    from syncplan.planning.variations import sweep
    from syncplan.plotting import figures
    from syncplan.plotting.printed_report import report_page
    from syncplan.recordings.recording_formats import load_log
    from syncplan.refinement.refiner import refine
    from syncplan.scenario.brief import Brief
    from syncplan.scenario.loading import load_scenario
    from syncplan.scenario.specification import Scenario


def __getattr__(name: str) -> Any:
    """Load a public name where it is first used, so that importing syncplan costs nothing."""
    if name in _MODULES:
        return import_module(f"syncplan.{_MODULES[name]}")
    if name not in _HOME:
        raise AttributeError(f"module 'syncplan' has no attribute {name!r}")
    return getattr(import_module(f"syncplan.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
