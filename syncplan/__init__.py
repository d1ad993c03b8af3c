"""syncplan: synchronised circular orbits that let a team of robots localise itself.

From a scenario (circles, sensors, a few known landmarks) to phases at which neighbours meet once a
turn, a verdict on whether the union of their sightings makes every position and heading
observable, the least error any filter can reach, and a Monte Carlo of an extended Kalman filter
that proves it.

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

Modules, each using only those before it
----------------------------------------
    errors, formation, areas, quantities,     what the user says, checked
    georeference, refine_options, checks,
    sections, scenario, loading, candidates
    blas, cores, children                     threads, cores, child processes
    orbits, trigpoly, contacts, separation    circles, exact contact windows, least distances
    sightings, noise, graph                   samples, sigmas, who sees whom
    rules, slack, relaxation, senses, sync    phases and senses
    placing.*, placement                      centres, from links or from a gap
    observability, certificate, motions       rank, why it holds, what is lost
    connectivity, bounds, meetings            how often, how well, each pair
    arcs, ekf, consistency                    the filter, and whether it is honest
    trials, montecarlo, parts                 many runs of it
    logs, replays                             a run on real robots' readings
    refining.*                                a smooth copy for the solver, exact measures
    planner, refinement                       the chain: plan, judge, refine
    siting.*, landmark_sites                  which landmark sites tell most
    validation, sweeps                        a plan flown, many plans compared
    document, *_report                        contracts
    planfile, output                          files
    plotting.*, figures                       what is drawn: plain values; Plotly's figures
    exporting.*, exports                      other programs' formats
    remote, client                            the same, computed by a service
    streams, tables, arguments,               the command line
    plan_commands, run_commands,
    plot_commands, export_commands,
    service_commands, cli

References
----------
"Observability Conditions for Switching Sensing Topology for Cooperative Localization" (the paper);
Diaz-Banez et al., "A general framework for synchronizing a team of robots under communication
constraints", IEEE Transactions on Robotics, 2017.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__all__ = [
    "Client",
    "InputError",
    "NoSolutionError",
    "Plan",
    "Replay",
    "Scenario",
    "SyncplanError",
    "Validation",
    "export",
    "load_log",
    "load_scenario",
    "place",
    "plan",
    "refine",
    "replay",
    "sweep",
    "validate",
]

__version__ = "0.1.0"

_HOME = {
    "Client": "client",
    "InputError": "errors",
    "NoSolutionError": "errors",
    "Plan": "planner",
    "Replay": "replays",
    "Scenario": "scenario",
    "SyncplanError": "errors",
    "Validation": "validation",
    "export": "exports",
    "load_log": "logs",
    "load_scenario": "loading",
    "place": "placement",
    "plan": "planner",
    "refine": "refinement",
    "replay": "replays",
    "sweep": "sweeps",
    "validate": "validation",
}

if TYPE_CHECKING:
    from syncplan.client import Client
    from syncplan.errors import InputError, NoSolutionError, SyncplanError
    from syncplan.exports import export
    from syncplan.loading import load_scenario
    from syncplan.logs import load_log
    from syncplan.placement import place
    from syncplan.planner import Plan, plan
    from syncplan.refinement import refine
    from syncplan.replays import Replay, replay
    from syncplan.scenario import Scenario
    from syncplan.sweeps import sweep
    from syncplan.validation import Validation, validate


def __getattr__(name: str) -> Any:
    """Load a public name where it is first used, so that importing syncplan costs nothing."""
    if name not in _HOME:
        raise AttributeError(f"module 'syncplan' has no attribute {name!r}")
    return getattr(import_module(f"syncplan.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
