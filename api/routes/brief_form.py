"""The page's form of a brief: its groups, kinds and labels; all else follows from the model."""

from collections.abc import Mapping
from typing import Any

from api.routes.study_routes import described_key
from syncplan.scenario.brief import Brief
from syncplan.scenario.specification import Scenario

GROUPS: Mapping[str, Mapping[str, str | None]] = {
    "Purpose": {
        "purpose.cover.share": None,
        "purpose.cover.swath_m": "Swath",
        "purpose.visit_m": "Points to visit",
        "purpose.within_m": "Passing distance",
        "purpose.keep.count": "Vehicles to keep apart",
        "purpose.keep.spread_m": None,
    },
    "Need": {
        "need.worst_rms_m": "Error of the worst vehicle",
        "need.losses": "Losses withstood",
    },
    "Vehicles": {
        "team.min": None,
        "team.max": None,
        "vehicle.speed_mps": "Speed of a vehicle",
        "vehicle.min_radius_m": None,
        "vehicle.bank_deg": None,
        "vehicle.turn_rate_rad_s": None,
    },
    "Sensor": {
        "sensor.range_m": "Range of the sensor",
        "sensor.bearing_sigma_rad": "Sigma of a bearing",
    },
    "Landmarks": {
        "landmarks.candidates_m": "Candidate sites",
        "landmarks.given": "Present landmarks",
        "landmarks.max": "Most landmarks",
    },
    "Search": {"effort": "Effort"},
}
"""Labels of the form's fields by key, in groups by title; None for the key's description."""

KINDS: Mapping[str, Mapping[str, str]] = {
    "Purpose": {
        "cover": "Cover a share of the area",
        "visit_m": "Visit points",
        "keep": "Keep vehicles apart",
    },
    "Landmarks": {
        "": "Anywhere in the area",
        "on_edge": "On the edge of the area",
        "candidates_m": "On some of the candidate sites",
        "given": "Where they are already",
    },
}
"""Kinds of a group's section, by the key of which a brief has one at most; the group's title is
that of the section."""

_OF_KIND = {"purpose.within_m": "visit_m"}
"""Keys that a kind needs beside its own."""

_INPUTS = {"vehicle.speed_mps": {"kind": "span"}}
"""Inputs for what is neither a number nor a name; the others are for places."""

_FIELD = ("name", "area", "keep_out", "obstacles", "geo_origin", "purpose")


def brief_form() -> dict[str, Any]:
    """Return the form's groups, and the keys for which a scenario's values are the defaults."""
    schema = Brief.model_json_schema()

    def field(key: str, label: str | None, kinds: Mapping[str, str]) -> dict[str, Any]:
        described = described_key(schema, key).model_dump(mode="json")
        words = {"label": label} if label else {"label": described["sentence"], "sentence": ""}
        if described["kind"] == "document":
            words |= _INPUTS.get(key, {"kind": "places", "unit": "m"})
        part = key.partition(".")[2].partition(".")[0]
        of = _OF_KIND.get(key, part if part in kinds else None)
        return {**described, **words, "of": of}

    groups = []
    for title, labels in GROUPS.items():
        kinds = KINDS.get(title, {})
        fields = [field(key, label, kinds) for key, label in labels.items()]
        groups.append({"title": title, "kinds": kinds or None, "fields": fields})
    both = [key for key in Brief.model_fields if key in Scenario.model_fields]
    return {"groups": groups, "shared": [key for key in both if not key.startswith(_FIELD)]}
