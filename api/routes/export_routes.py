"""Plans as files that mission planners load, in a zip archive."""

import json
from typing import TYPE_CHECKING, Annotated, Literal

from fastapi import APIRouter, Depends, Query, Response
from pydantic import BaseModel, Field

from api.callers import CurrentCaller, computed
from api.negotiation import accepts
from api.problems import problem_responses
from api.routes.plan_routes import Identifier, find_or_refuse
from syncplan.exporting.format_table import ALL, FORMATS, AutopilotName, VehicleName

NOTES = "Syncplan-Notes"
_NOTES_HEADER = {
    "description": "What the reader must not miss, as the sidecar has it: a JSON array of strings, "
    "in ASCII",
    "schema": {"type": "string", "contentMediaType": "application/json"},
}

router = APIRouter(tags=["exports"], dependencies=[Depends(accepts("application/zip"))])

if TYPE_CHECKING:
    ExportName = str
else:
    ExportName = Literal[*FORMATS, ALL]


class ExportQuery(BaseModel):
    """Options of an export, as syncplan.exporting.format_table has them."""

    autopilot: AutopilotName = Field("ardupilot", description="Autopilot that missions are for")
    vehicle: VehicleName = Field("multicopter", description="Kind of vehicle that flies them")
    altitude_m: float | None = Field(
        None,
        ge=-1000,
        le=100_000,
        description="Height above the origin; the format's own if not given",
    )
    altitude_step_m: float = Field(
        0.0, ge=0, le=1000, description="How much higher each vehicle flies than the one before"
    )
    turns: int | None = Field(
        None,
        ge=1,
        le=20_000,
        description="Whole turns flown; the scenario's duration if not given",
    )
    waypoints: bool = Field(False, description="Waypoints where loiter turns would do")
    snap_radius: bool = Field(False, description="Fly the nearest radii that ArduPilot can store")
    force: bool = Field(False, description="Export the plan although its verdict is no-go")


@router.get(
    "/plans/{plan_id}/exports/{format}",
    response_class=Response,
    operation_id="exportPlan",
    summary="Export a plan",
    responses={
        200: {"content": {"application/zip": {}}, "headers": {NOTES: _NOTES_HEADER}},
        **problem_responses(401, 404, 406, 409, 422, 429, 503),
    },
)
async def read_export(
    plan_id: Identifier,
    format: ExportName,
    caller: CurrentCaller,
    query: Annotated[ExportQuery, Query()],
) -> Response:
    """The files of a format, one for each vehicle where it holds one, and the sidecar with phases.

    The sidecar says how each vehicle joins its circle at the right phase, and what to watch for.
    """
    row = await find_or_refuse(caller.service, caller.owner, plan_id)
    archive, notes = await computed(caller, "exported", row.text, format, query.model_dump())
    headers = {
        "content-disposition": f'attachment; filename="plan-{format}.zip"',
        NOTES: json.dumps(notes),
    }
    return Response(archive, headers=headers, media_type="application/zip")
