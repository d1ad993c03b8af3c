"""Validations: the filter run many times on a plan, in the stated world or also in worse ones."""

from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import Any

from syncplan.estimation.filter_options import FilterOptions, ValidationOptions
from syncplan.studies.study import DocumentKind, TrialStudy


class Validations(TrialStudy):
    """Monte Carlo runs of the filter on a plan."""

    name, verb, of = "validation", "validate", "plan"
    sentence = (
        "Simulate a plan many times with the filter: Monte Carlo errors beside the bound, and "
        "consistency."
    )
    example = "plan.json --trials 500 --seed 1 -o report.json"
    requires = ("observable", "go", "flown", "robust")
    options = ValidationOptions
    body = "How to fly; defaults if empty"
    document = DocumentKind(
        "syncplan.reports.validation_report", "ValidationDocument", title="Validation"
    )

    def work(self, subject: Any, options: ValidationOptions) -> int:
        """Return the number of trials in all worlds."""
        from syncplan.planning.variations import stress_worlds
        from syncplan.scenario.truths import with_truth

        world = with_truth(subject.scenario, options.truth or {})
        return options.trials * (1 + len(stress_worlds(world)) if options.stress else 1)

    def first_run(self, subject: Any, options: Any) -> Any:
        """Return the set-up in the world as stated."""
        from syncplan.planning.validation import trial_run

        shared = {field.name: getattr(options, field.name) for field in fields(FilterOptions)}
        return trial_run(subject, FilterOptions(**shared))

    def runs(self, subject: Any, options: Any) -> Iterable[Any]:
        """Return the set-up in the world as stated, and those in worse worlds if asked for."""
        from syncplan.planning.variations import stress_runs

        if not options.stress:
            return super().runs(subject, options)
        return stress_runs(subject, options).values()

    def joined(self, subject: Any, options: Any, results: Sequence[Any]) -> Any:
        """Return the validation, or the stress test of those in all worlds."""
        from syncplan.planning.variations import joined_worlds, stress_worlds

        nominal, *others = results
        if not others:
            return nominal
        return joined_worlds(["", *stress_worlds(nominal.plan.scenario)], results)
