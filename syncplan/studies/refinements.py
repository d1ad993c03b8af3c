"""Refinements: phases, centres and radii moved to a better plan."""

from typing import TYPE_CHECKING, Any

from syncplan.studies.study import ALONE, Execution, Study

if TYPE_CHECKING:
    from syncplan.refinement.refiner import BetterPlan


class Refinements(Study):
    """The best plan near a plan; the plan itself, with the reason, if none is better."""

    name, verb, of = "refinement", "refine", "plan"
    sentence = "Move phases, centres and radii to the best plan near the one given."
    unit = "starts"
    body = "What changes of the plan's own options; nothing if empty"
    events = "the best plan so far"
    ends_early = True
    parallel = True

    @property
    def options(self) -> type[Any]:
        """Class of the options, a section of scenarios; a request gives those that change."""
        from syncplan.scenario.models import RefineOptions

        return RefineOptions

    def work(self, subject: Any, options: dict[str, Any]) -> int:
        """Return the number of starts."""
        from syncplan.refinement.refiner import options_for

        return options_for(subject.scenario, None, options).starts

    def run(self, subject: Any, options: dict[str, Any], how: Execution = ALONE) -> Any:
        """Return the refined plan.

        Progress counts the starts that must have ended because others have begun; `best` is the
        best plan so far.
        """
        from syncplan.refinement.refiner import refine
        from syncplan.reports.refinement_report import plan_so_far
        from syncplan.runtime.machine import usable_cores

        begun = set(how.earlier.finished) if how.earlier else set()
        processes = how.workers or usable_cores()

        def heard(start: int, iteration: int, objective: float) -> None:
            begun.add(start)
            how.progress(max(len(begun) - processes, 0))

        def better(plan: "BetterPlan") -> None:
            how.progress(0, best=plan_so_far(plan).as_json())

        return refine(
            subject,
            workers=how.workers,
            progress=heard,
            better=better,
            earlier=how.earlier,
            **options,
        )
