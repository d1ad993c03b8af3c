"""What losses of vehicles, sensors and landmarks do to a plan."""

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Response

from api.callers import CurrentCaller, computed
from api.negotiation import accepts
from api.problems import problem_responses
from api.routes.plan_routes import Identifier, find_or_refuse
from syncplan.planning.planner import BoundChoice
from syncplan.reports.loss_report import WhatIfDocument

router = APIRouter(tags=["plans"], dependencies=[Depends(accepts("application/json"))])


@router.get(
    "/plans/{plan_id}/what-if",
    response_model=WhatIfDocument,
    operation_id="judgeLosses",
    summary="Judge losses",
    responses=problem_responses(401, 404, 406, 422, 429, 503),
)
async def read_losses(
    plan_id: Identifier,
    caller: CurrentCaller,
    lose: Annotated[
        list[Annotated[str, Query(max_length=80)]] | None,
        Query(
            description="Names of what is lost together: vehicles, landmarks, and sensors as "
            "sensor:v3, compass:v3 or distance:v3; every loss is judged if not given",
            max_length=64,
        ),
    ] = None,
    losses: Annotated[
        Literal["1", "2"], Query(description="Judge every loss of one, or of up to two")
    ] = "1",
    bound: Annotated[
        BoundChoice, Query(description="Predict errors: auto leaves very large teams out")
    ] = "auto",
) -> Response:
    """The plan without each vehicle, sensor or landmark, orbits unchanged, judged afresh.

    The most harmful loss comes first. A vehicle whose sensor is lost flies on and is seen by
    others.
    """
    row = await find_or_refuse(caller.service, caller.owner, plan_id)
    found = await computed(caller, "judged_losses", row.text, lose or [], int(losses), bound)
    return Response(found, media_type="application/json")
