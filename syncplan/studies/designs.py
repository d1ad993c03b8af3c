"""Designs: the cheapest team that meets a brief, or what stands in its way."""

from typing import TYPE_CHECKING, Any

from syncplan.studies.study import ALONE, DocumentKind, Execution, Study

if TYPE_CHECKING:
    from syncplan.designs.ladder import DesignState


class Designs(Study):
    """The cheapest team that meets a brief; the brief is the options."""

    name, verb, of = "design", "design", "team"
    sentence = (
        "Find the cheapest team that meets a brief: field, vehicles, sensors, purpose, error "
        "allowed."
    )
    unit = "searches"
    body = "The brief"
    document = DocumentKind("syncplan.reports.design_report", "DesignDocument", title="Design")
    events = "the front found so far"
    ends_early = True
    parallel = True

    @property
    def options(self) -> type[Any]:
        """Class of briefs."""
        from syncplan.scenario.brief import Brief

        return Brief

    def work(self, subject: None, options: Any) -> int:
        """Return the number of searches."""
        from syncplan.designs.ladder import orders_of

        return max(len(orders_of(options)), 1)

    def run(self, subject: None, options: Any, how: Execution = ALONE) -> Any:
        """Return the design; progress has what is done just now, and the front so far."""
        from syncplan.designs.designer import design
        from syncplan.reports.design_report import front_point

        def heard(state: "DesignState") -> None:
            front = [front_point(options, team).as_json() for team in state.front]
            how.progress(state.done, doing=state.doing, front=front)

        return design(options, workers=how.workers, progress=heard, earlier=how.earlier)
