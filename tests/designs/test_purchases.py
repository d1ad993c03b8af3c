"""Purchases: whoever buys one has the error that is stated, by prediction and by trials."""

import pytest

from syncplan.designs.designer import design
from syncplan.designs.purchases import offers_for
from syncplan.planning.plan_files import loaded_from, plan_of
from syncplan.planning.validation import validate
from syncplan.reports.design_report import design_document
from tests.tools.briefs import brief, broken


@pytest.mark.long
def test_five_purchases_bring_the_errors_stated() -> None:
    team, purpose = {"min": 2, "max": 2}, {"keep": {"count": 2, "spread_m": 60.0}}
    given = brief(team=team, purpose=purpose, purchases=True)
    designed = design(given)
    assert designed.status == "met"
    assert designed.best is not None
    bought = {offer.words: offer.brief for offer in offers_for(given, designed.best.start.cell)}
    purchases = design_document(designed).purchases
    assert len(purchases) >= 5
    for purchase in purchases[:5]:
        assert purchase.worst_rms_m < designed.best.worst
        made = plan_of(loaded_from(purchase.formation))
        assert made.prediction.rms is not None
        assert made.prediction.rms.max() == pytest.approx(purchase.worst_rms_m, rel=1e-9)
        assert broken(bought[purchase.change], made) == []
        error = validate(made, trials=100, seed=7).accuracy.late_position.max()
        # the worst of the vehicles of 100 trials
        assert error < 1.2 * purchase.worst_rms_m
