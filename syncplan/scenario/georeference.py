"""Where on Earth the plane of a scenario lies."""

from typing import Annotated

from pydantic import Field

from syncplan.scenario.quantities import Section

Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=180)]
Altitude = Annotated[float, Field(ge=-1000, le=100_000)]


class GeoOrigin(Section):
    """The point on Earth (WGS 84) at which the plane has [0, 0]."""

    lat_deg: Latitude = Field(description="Latitude, positive north", examples=[47.3977])
    lon_deg: Longitude = Field(description="Longitude, positive east", examples=[8.5456])
    alt_m: Altitude = Field(
        default=0.0,
        description="Altitude above mean sea level, used by autopilots as that of home",
        examples=[488.0],
    )
