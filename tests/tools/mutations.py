"""Requests that a fuzzer sends: valid scenarios with something done to them, and worse."""

import copy
import gzip
import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import syncplan
from syncplan.planning.plan_files import stated
from syncplan.scenario.dotted_keys import numeric_keys, with_number
from syncplan.scenario.loading import parse_document
from tests.tools.scenarios import FILES

__all__ = ["FIGURES", "Sent", "draw_request", "valid_scenarios"]

Draw = np.random.Generator
Tree = dict[str, Any]

JSON, YAML = "application/json", "application/yaml"
BODY_LIMIT = 2**20


@dataclass(frozen=True, slots=True)
class Sent:
    """A request: `name` says what was done, `pieces` are sent one after another.

    Attributes
    ----------
    cut : whether the client goes away before its request is complete
    """

    name: str
    path: str
    body: bytes
    headers: dict[str, str] = field(default_factory=dict)
    chunks: int = 0
    cut: bool = False
    method: str = "POST"

    def pieces(self) -> list[bytes]:
        """Return the bytes on the wire."""
        length = {"Content-Length": str(len(self.body) + 100 * self.cut)}
        framing = {"Transfer-Encoding": "chunked"} if self.chunks else length
        headers = self.headers | {k: v for k, v in framing.items() if k not in self.headers}
        head = f"{self.method} {self.path} HTTP/1.1\r\nHost: syncplan\r\n"
        head += "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        opening = head.encode("latin-1") + b"\r\n"
        if not self.chunks:
            return [opening, self.body]
        size = max(1, math.ceil(len(self.body) / self.chunks))
        parts = [self.body[k : k + size] for k in range(0, len(self.body), size)]
        return [opening, *(b"%x\r\n%s\r\n" % (len(one), one) for one in parts), b"0\r\n\r\n"]


LARGEST_TEAM = 10
"""Most vehicles of a valid scenario: the services that are searched have limits of their own."""

LONGEST_RUN_S = 200.0
"""Longest run of one."""


def valid_scenarios() -> list[Tree]:
    """Return the documents of examples/scenarios, and at the end a plan in place of one.

    Every other one is on Earth and dated. What is larger than small services take stays out: teams,
    and the rest of long runs.
    """
    files = [
        path
        for path in sorted(FILES.glob("*.yaml"))
        if syncplan.load_scenario(path).size <= LARGEST_TEAM
    ]
    made = syncplan.plan(syncplan.load_scenario(FILES / "four-ground-robots.yaml"))
    given = json.loads(json.dumps(stated(made.scenario, made.orbits)))
    found = [parse_document(path.read_text(), "") for path in files]
    for document in found:
        if document.get("duration_s", 0.0) > LONGEST_RUN_S:
            document["duration_s"] = LONGEST_RUN_S
    for document in found[::2]:
        document["geo_origin"] = {"lat_deg": 47.4, "lon_deg": 8.5, "alt_m": 488.0}
        document["start_time"] = "2027-05-01T09:00:00Z"
    return [*found, given]


def draw_request(draw: Draw, scenarios: list[Tree], plans: list[str]) -> Sent:
    """Return a drawn request for a plan, or one about one of `plans`."""
    kind = draw.random()
    return next(made for below, made in KINDS if kind < below)(draw, scenarios, plans)


# --- values in odd places -------------------------------------------------------------------------


VERBATIM = "\x01"
"""Begins a text that is written as it stands, without quotes: NaN, 1e999, a thousand digits."""

ODD: list[Any] = [
    *(f"{VERBATIM}{text}" for text in ("NaN", "Infinity", "-Infinity", "1e999", "-1e999")),
    *(f"{VERBATIM}{'9' * digits}" for digits in (400, 5000)),
    *(1e308, -1e308, 5e-324, 1e-300, 1e22, 2**53 + 1, 2**63, -(2**63), 10**30, -0.0, 0, -1, 1),
    *(True, False, None, "", "1", "ccw", "v1", "NaN", "\u0000", "\ud800", "\u202e", "\U0001f6f0"),
    *("x" * 65, "x" * 100_000, "{{}}", "{0}", "%s", "../../etc/passwd", "v1\r\nX-Y: 1"),
    *([], {}, [[]], [None], [[0, 0]], {"a": 1}, [1, [2, [3, [4]]]], {"": ""}, [True, False]),
]


def _odd(draw: Draw) -> Any:
    return copy.deepcopy(ODD[draw.integers(len(ODD))])


def _places(node: Any, above: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths of everything inside a document."""
    if not isinstance(node, dict | list):
        return []
    inner = node.items() if isinstance(node, dict) else enumerate(node)
    return [
        path for key, value in inner for path in [(*above, key), *_places(value, (*above, key))]
    ]


def _mutated(draw: Draw, document: Tree) -> Tree:
    """A copy with one to three things done to it."""
    made: Tree = json.loads(json.dumps(document))
    for _ in range(draw.integers(1, 4)):
        places = _places(made)
        if not places:
            return made
        *above, key = places[draw.integers(len(places))]
        node: Any = made
        for part in above:
            node = node[part]
        MUTATIONS[draw.integers(len(MUTATIONS))](draw, node, key)
    return made


def _replace(draw: Draw, node: Any, key: Any) -> None:
    node[key] = _odd(draw)


def _remove(draw: Draw, node: Any, key: Any) -> None:
    del node[key]


def _wrap(draw: Draw, node: Any, key: Any) -> None:
    node[key] = [node[key]] * int(draw.integers(1, 12))


def _add(draw: Draw, node: Any, key: Any) -> None:
    if isinstance(node, dict):
        node[f"{key}{draw.choice(ENDINGS)}"] = _odd(draw)
    else:
        node.insert(key, _odd(draw))


def _scale(draw: Draw, node: Any, key: Any) -> None:
    if isinstance(node[key], int | float) and not isinstance(node[key], bool):
        node[key] = float(node[key]) * 10.0 ** draw.uniform(-12.0, 12.0)
    else:
        node[key] = _odd(draw)


def _repeat(draw: Draw, node: Any, key: Any) -> None:
    value = node[key]
    node[key] = value * int(draw.integers(2, 40)) if isinstance(value, list) else _odd(draw)


ENDINGS = ["x", " ", "\u0301", ""]

Mutation = Callable[[Draw, Any, Any], None]

MUTATIONS: list[Mutation] = [_replace, _remove, _wrap, _add, _scale, _repeat]


_UNQUOTED = re.compile(r'"\\u0001([^"]*)"')


def _written(document: Any) -> bytes:
    """JSON as written by hand: odd numbers as they stand, lone surrogates as escapes."""
    return _UNQUOTED.sub(r"\1", json.dumps(document)).encode()


def _scenario(draw: Draw, scenarios: list[Tree], plans: list[str]) -> Sent:
    document = _mutated(draw, scenarios[draw.integers(len(scenarios))])
    media = YAML if draw.random() < 0.25 else JSON
    return Sent("mutated", "/v1/plans", _written(document), {"Content-Type": media})


# --- valid, or nearly, and at some limit ----------------------------------------------------------


def _extreme(draw: Draw, scenarios: list[Tree], plans: list[str]) -> Sent:
    document: Tree = json.loads(json.dumps(scenarios[draw.integers(len(scenarios))]))
    name = str(draw.choice(sorted(EXTREMES)))
    EXTREMES[name](draw, document)
    steady = "?steady=true" if draw.random() < 0.1 else ""
    return Sent(name, f"/v1/plans{steady}", _written(document), {"Content-Type": JSON})


def _log(draw: Draw, least: float, most: float) -> float:
    return float(10.0 ** draw.uniform(math.log10(least), math.log10(most)))


def _one_place(draw: Draw, document: Tree) -> None:
    document["formation"] = {"centers_m": [[0.0, 0.0]] * int(draw.integers(2, 60))}
    document["orbit"] = {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "ccw"}
    document["sensor"] = {"range_m": 50.0, "sample_time_s": 1.0}


def _sigmas(draw: Draw, document: Tree) -> None:
    document["sensor"] = {
        "range_m": _log(draw, 1e-6, 1e7),
        "bearing_sigma_rad": _log(draw, 1e-6, 3.0),
        "sample_time_s": 0.1,
    }
    document["motion"] = {
        "speed_sigma_mps": draw.choice([0.0, _log(draw, 1e-9, 1e3)]),
        "turn_rate_sigma_rad_s": draw.choice([0.0, _log(draw, 1e-9, 1e3)]),
    }
    document["initial_sigma"] = {
        "position_m": _log(draw, 1e-6, 1e6),
        "heading_rad": _log(draw, 1e-6, 100.0),
    }


def _times(draw: Draw, document: Tree) -> None:
    document["duration_s"] = _log(draw, 1e-3, 1e9)
    document["window_s"] = _log(draw, 1e-3, 1e9)
    document["sensor"] = {"range_m": 50.0, "sample_time_s": _log(draw, 1e-6, 1e6)}
    document["orbit"] = {"radius_m": 20.0, "angular_rate_rad_s": _log(draw, 1e-6, 1e4)}


def _samples(draw: Draw, document: Tree) -> None:
    document["duration_s"] = float(draw.choice([1999.9, 2000.0, 2000.1, 1e4]))
    document["sensor"] = {"range_m": 50.0, "sample_time_s": 0.1}


def _sizes(draw: Draw, document: Tree) -> None:
    scale = _log(draw, 1e-7, 1e7)
    count = int(draw.integers(1, 7))
    document["orbit"] = {"radius_m": scale, "angular_rate_rad_s": 0.2}
    document["formation"] = {"centers_m": (scale * draw.uniform(-5.0, 5.0, (count, 2))).tolist()}
    document["landmarks_m"] = (scale * draw.uniform(-5.0, 5.0, (3, 2))).tolist()
    document["sensor"] = {"range_m": scale * 3.0, "sample_time_s": 0.5}


def _team(draw: Draw, document: Tree) -> None:
    shape = str(draw.choice(["line", "grid", "hex", "ring"]))
    count = int(draw.choice([30, 60, 200, 201, 2000, 10_000_000, 10_000_001]))
    document["formation"] = {"shape": shape, "count": count, "spacing_m": 70.0}
    document["sensor"] = {"range_m": 50.0, "sample_time_s": 1.0}
    document["orbit"] = {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "alternate"}


def _names(draw: Draw, document: Tree) -> None:
    pool = ["\u03b1", "\U0001f6f0", "a\u0301", "\u00e1", "v1", "V1", " v", "L1", "\u200b", "\ufeff"]
    names = [str(one) for one in draw.choice(pool, 4, replace=bool(draw.random() < 0.2))]
    document["formation"] = {"centers_m": {n: [70.0 * k, 0.0] for k, n in enumerate(names)}}
    document["orbit"] = {"radius_m": 20.0, "angular_rate_rad_s": 0.2}
    document["sensor"] = {"range_m": 50.0}


def _polygons(draw: Draw, document: Tree) -> None:
    corners = draw.uniform(-400.0, 400.0, (int(draw.integers(0, 60)), 2)).tolist()
    document["area_m" if draw.random() < 0.5 else "keep_out_m"] = corners
    if "keep_out_m" in document:
        document["keep_out_m"] = [corners] * int(draw.integers(1, 30))


def _world(draw: Draw, document: Tree) -> None:
    """Some of the keys of errors that last, of further sightings and of what blocks sight."""
    keys = {key: one for key, one in numeric_keys().items() if key.startswith(_WORLD)}
    for key in draw.choice(sorted(keys), int(draw.integers(1, 6)), replace=False).tolist():
        document.update(with_number(document, key, _log(draw, 1e-6, 1e3)))
    sensor = document.get("sensor", {})
    document["sensor"] = {"range_m": 50.0, **(sensor[0] if isinstance(sensor, list) else sensor)}
    if draw.random() < 0.5:
        document["sensor"]["interval_s"] = float(draw.choice([0.1, 0.5, 0.25, 3.0]))
    if draw.random() < 0.5:
        document["sensor"]["detection_probability"] = float(draw.choice([1e-6, 0.3, 1.0]))
    if draw.random() < 0.5:
        estimate: Any = ["auto", "all", "none", ["wind"], ["gusts", "speed_scale"]]
        document["filter"] = {"estimate": estimate[int(draw.integers(len(estimate)))]}
    if draw.random() < 0.5:
        sigmas = draw.choice([0.1, 1e-6, 3.0], int(draw.integers(1, 7)))
        document["heading_sigma_rad"] = sigmas.tolist()
    corners = draw.uniform(-200.0, 200.0, (int(draw.integers(3, 9)), 2)).tolist()
    document["obstacles_m"] = [corners] * int(draw.integers(0, 3))


_WORLD = (
    *("wind.", "sensor.range_sigma", "sensor.bearing_bias", "sensor.bearing_walk"),
    *("heading_sigma", "motion.position_random", "motion.angle_random", "motion.speed_scale"),
    "motion.turn_rate_bias",
)


def _placement(draw: Draw, document: Tree) -> None:
    count = int(draw.integers(2, 9))
    pairs = [[f"v{k + 1}", f"v{draw.integers(1, count + 1)}"] for k in range(count)]
    document["formation"] = {"links": pairs, "count": count}
    document["orbit"] = {"radius_m": _log(draw, 0.1, 1e5), "angular_rate_rad_s": 0.2}
    document["sensor"] = {"range_m": 50.0, "sample_time_s": 0.5}


EXTREMES: dict[str, Callable[[Draw, Tree], None]] = {
    "names": _names,
    "one place": _one_place,
    "placement": _placement,
    "polygons": _polygons,
    "samples": _samples,
    "sigmas": _sigmas,
    "sizes": _sizes,
    "team": _team,
    "times": _times,
    "world": _world,
}


# --- jobs -----------------------------------------------------------------------------------------


def _swept(draw: Draw) -> Tree:
    """A list of a swept key, or any key with its values."""
    if draw.random() < 0.5:
        return {"angular_rate_rad_s": [0.2, 0.4]}
    key = str(draw.choice([*numeric_keys(), "sensor.colour", "name"]))
    return {"key": key, "values": [_log(draw, 1e-3, 1e3) for _ in range(int(draw.integers(1, 4)))]}


def _job(draw: Draw, scenarios: list[Tree], plans: list[str]) -> Sent:
    small = {"trials": int(draw.integers(1, 20)), "duration_s": 5.0}
    events = {"lose": ["v1@2"], "hold": ["v1@0.5:1"]}
    wrong = {"late": 1, "outliers": 0.1, "wind_mps": [0.5, 0.0]}
    bodies: dict[str, Tree] = {
        "refinements": {"starts": 1, "time_limit_s": 0.5, "center_box_m": 2.0},
        "validations": {**small, "seed": 1, "gate_probability": 0.99, "series": True},
        "flights": {**small, "trials": 2, "guidance": "track", **events, **wrong},
        "sweeps": {**small, "scenario": scenarios[0], **_swept(draw)},
    }
    kind = str(draw.choice(sorted(bodies)))
    path = "/v1/sweeps" if kind == "sweeps" else f"/v1/plans/{_plan(draw, plans)}/{kind}"
    body = _mutated(draw, bodies[kind]) if draw.random() < 0.8 else bodies[kind]
    empty = draw.random() < 0.05
    headers = {} if empty else {"Content-Type": YAML if draw.random() < 0.2 else JSON}
    return Sent(f"job: {kind}", path, b"" if empty else _written(body), headers)


def _plan(draw: Draw, plans: list[str]) -> str:
    if draw.random() < 0.85:
        return plans[draw.integers(len(plans))]
    odd = ["0" * 36, "%00", "..%2f..", "a" * 5000, "%ff", "%0d%0aX:1", "-" * 36, "x" * 36, "%F0%9F"]
    return odd[draw.integers(len(odd))]


# --- previews, figures and exports ----------------------------------------------------------------

FIGURES = ["formation", "animation", "timeline", "spectrum", "prediction", "refinement"]
EXPORTS = ["qgc", "ardupilot", "csv", "rosbag2", "mcap", "crazyswarm", "geojson", "kml", "all"]
OPTIONS: dict[str, list[str]] = {
    "autopilot": ["ardupilot", "px4"],
    "vehicle": ["multicopter", "fixed_wing"],
    "altitude_m": ["0", "60", "-1000", "100000", "1e5"],
    "altitude_step_m": ["0", "5", "1000"],
    "turns": ["1", "3", "20000"],
    "waypoints": ["true", "false"],
    "snap_radius": ["true", "false"],
    "force": ["true", "false"],
    "quick": ["true", "false"],
    "theme": ["light", "dark"],
    "figure": FIGURES,
}
ODD_VALUES = ["", "%00", "nan", "inf", "-1e999", "9" * 400, "%FF", "../..", "1&1", "%F0%9F%9B%B0"]


def _rendition(draw: Draw, scenarios: list[Tree], plans: list[str]) -> Sent:
    kind = str(draw.choice(["preview", "figure", "export"]))
    query = _query(draw)
    if kind == "preview":
        document = scenarios[draw.integers(len(scenarios))]
        made = _mutated(draw, document) if draw.random() < 0.7 else document
        return Sent(kind, f"/v1/previews{query}", _written(made), {"Content-Type": JSON})
    names = FIGURES if kind == "figure" else EXPORTS
    name = str(draw.choice([*names, *ODD_VALUES] if draw.random() < 0.2 else names))
    path = f"/v1/plans/{_plan(draw, plans)}/{kind}s/{name}{query}"
    return Sent(f"{kind} {name[:12]}", path, b"", method="GET")


def _query(draw: Draw) -> str:
    """Some of the options that there are, now and then with odd values, or twice."""
    asked = draw.choice(sorted(OPTIONS), size=int(draw.integers(0, 4)))
    odd = draw.random() < 0.3
    parts = [f"{key}={draw.choice(ODD_VALUES if odd else OPTIONS[key])}" for key in asked.tolist()]
    return f"?{'&'.join(parts)}" if parts else ""


# --- bodies that are hardly documents -------------------------------------------------------------


def _wild(draw: Draw, scenarios: list[Tree], plans: list[str]) -> Sent:
    document = scenarios[draw.integers(len(scenarios))]
    name, media, body = WILD[draw.integers(len(WILD))](draw, document)
    path = "/v1/plans" if draw.random() < 0.85 else "/v1/sweeps"
    return Sent(name, path, body, {"Content-Type": media})


Made = tuple[str, str, bytes]


def _deep(draw: Draw, document: Tree) -> Made:
    depth = int(draw.choice([100, 1000, 10_000, 100_000]))
    opening, closing = (b"[", b"]") if draw.random() < 0.5 else (b'{"a":', b"}")
    core = opening * depth + b"1" + closing * depth * int(draw.integers(0, 2))
    body = b'{"orbit":' + core + b"}" if draw.random() < 0.5 else core
    return "deep", JSON if draw.random() < 0.5 else YAML, body


def _deep_blocks(draw: Draw, document: Tree) -> Made:
    depth = int(draw.choice([100, 1000]))
    mark = draw.choice(["a:", "-", "?"])
    lines = [" " * k + str(mark) for k in range(depth)]
    return "deep blocks", YAML, "\n".join(lines).encode()


def _long_list(draw: Draw, document: Tree) -> Made:
    count = int(draw.choice([20_000, 200_000, 1_000_000]))
    value = draw.choice(["0", "[0,0]", '"a"', "null", "{}", "[", "1e999"])
    listed = b"[" + b",".join([str(value).encode()] * count) + b"]"
    key = draw.choice(["landmarks_m", "area_m", "nothing", "orbit", "keep_out_m"])
    rest = _written({k: v for k, v in document.items() if k != key})[:-1]
    body = rest + b', "' + str(key).encode() + b'": ' + listed + b"}"
    # a long list in YAML takes its time: rarely
    media = YAML if draw.random() < 0.03 else JSON
    return "long list", media, body


def _many_keys(draw: Draw, document: Tree) -> Made:
    count = int(draw.choice([1000, 50_000]))
    made: Tree = {f"k{k}": k for k in range(count)}
    section = draw.choice(["top", "orbit", "landmarks_m"])
    whole = {**document, **made} if section == "top" else {**document, str(section): made}
    return "many keys", JSON, _written(whole)


def _repeated_keys(draw: Draw, document: Tree) -> Made:
    body = _written(document)[:-1] + b', "orbit": 1, "orbit": 2, "name": "a"}'
    return "repeated keys", JSON if draw.random() < 0.5 else YAML, body


def _bomb(draw: Draw, document: Tree) -> Made:
    levels = int(draw.integers(2, 40))
    nodes = ["&a0 [0, 0]"]
    nodes += [f"&a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, levels)]
    block = "\n".join(f"a{k}: {one}" for k, one in enumerate(nodes))
    flow = f"{{{_written(document)[1:-1].decode()}, landmarks_m: [{', '.join(nodes)}]}}"
    body = block if draw.random() < 0.3 else flow
    return "alias bomb", YAML, body.replace('"landmarks_m"', '"landmarks"').encode()


SNIPPETS = [
    *("&a [*a]", "&a {orbit: *a}", "*nobody", "!!python/object/apply:os.system [id]"),
    *("!!binary aGVsbG8=", "!!timestamp 2026-05-01", "2026-05-01", "2026-05-01T09:00:00Z"),
    *("!!set {a, b}", "!!omap [a: 1, a: 2]", "!unknown 1", "!!float 'NaN'", "!!int 'x'"),
    *("{<<: {radius_m: 1}}", "{<<: [1, 2]}", "{<<: *a}", "{? [1, 2] : 3}", "{? {a: 1} : 3}"),
    *("{null: 1, 1: 2, 1.5: 3, true: 4}", ".nan", ".inf", "-.INF", "0x1F", "0o17", "1_000"),
    *("12:30:45", "~", "yes", "'\\ud800'", '"\\ud800"', '"\\x00"', "|\n  text"),
    *("%YAML 1.1\n---\n1", "1\n---\n2", "\t- 1", "\u2028", "\u0085", "@a", "`a`", "1e400"),
    "9" * 5000,
]


def _yaml(draw: Draw, document: Tree) -> Made:
    snippet = SNIPPETS[draw.integers(len(SNIPPETS))]
    keys = [*document, "name", "start_time", "sensor"]
    key = keys[draw.integers(len(keys))]
    lines = [f"{k}: {_written(v).decode()}" for k, v in document.items() if k != key]
    lines.insert(int(draw.integers(len(lines) + 1)), f"{key}: {snippet}")
    body = snippet if draw.random() < 0.1 else "\n".join(lines)
    return "yaml", YAML, body.encode()


def _encoding(draw: Draw, document: Tree) -> Made:
    text = _written({**document, "name": "caf\u00e9 \u03b1"}).decode("unicode_escape")
    coded = text.encode()
    bodies = [
        *(text.encode(name) for name in ("utf-16", "utf-16-le", "utf-32")),
        text.encode("latin-1", "replace"),
        *(b"\xef\xbb\xbf" + coded, b"\xef\xbb\xbf" * 2 + coded, coded + b"\x00", b"\x00" + coded),
        *(coded.replace(b"o", b"\x00"), coded.replace(b"a", b"\xed\xa0\x80")),
        coded.replace(b"a", b"\xc0\x80"),
        draw.bytes(int(draw.integers(1, 3000))),
        *(b"\xff" * 1000, b" " * 1000, b"\n"),
    ]
    body = bodies[draw.integers(len(bodies))]
    return "encoding", JSON if draw.random() < 0.5 else YAML, body


def _truncated(draw: Draw, document: Tree) -> Made:
    body = _written(document)
    return "truncated", JSON if draw.random() < 0.5 else YAML, body[: draw.integers(len(body))]


def _no_mapping(draw: Draw, document: Tree) -> Made:
    body = _written(_odd(draw)) if draw.random() < 0.5 else _written([document] * 3)
    return "no mapping", JSON if draw.random() < 0.5 else YAML, body


WILD: list[Callable[[Draw, Tree], Made]] = [
    *(_bomb, _deep, _deep_blocks, _encoding, _long_list, _many_keys, _no_mapping, _repeated_keys),
    *(_truncated, _yaml, _yaml),
]


# --- odd ways to send it --------------------------------------------------------------------------


TYPES = [
    *("text/plain", "application/jsonp", "application/xml", "multipart/form-data; boundary=x"),
    *("application/x-www-form-urlencoded", "application/json; charset=utf-16"),
    *("application/json; charset=latin-1", "application/json;;;", "application/json, text/yaml"),
    *("*/*", "x" * 10_000, "\xff\xfe", ""),
]


def _transport(draw: Draw, scenarios: list[Tree], plans: list[str]) -> Sent:
    body = _written(scenarios[draw.integers(len(scenarios))])
    json_type = {"Content-Type": JSON}
    zipped = {**json_type, "Content-Encoding": "gzip"}
    large = b" " * (BODY_LIMIT + int(draw.integers(0, 3)) - len(body)) + body
    too_large = b" " * int(draw.choice([BODY_LIMIT + 1, 3 * BODY_LIMIT]))
    kind = TYPES[draw.integers(len(TYPES))]
    length = str(draw.choice(["-1", "1e3", "9" * 30, "0x10", "+5", "1, 2", ""]))
    key = str(draw.choice(["", " ", "a" * 256, "\x7f", "\xe9", "a b", "same", "'\";--"]))
    condition = str(draw.choice(["", "*", '"', 'W/"a"', "\xff", "," * 5000]))
    accept = str(draw.choice(["text/html", "*/*;q=0", ";;;", "\xff", "a/b" * 5000]))
    queries = ["?steady=", "?steady=%00", "?steady=1&steady=0", "?" + "a=b&" * 3000]
    steady = str(draw.choice(queries))
    choices = [
        Sent("type", "/v1/plans", body, {"Content-Type": kind}),
        Sent("gzip", "/v1/plans", gzip.compress(body, mtime=0), zipped),
        Sent("zip bomb", "/v1/plans", BOMB, zipped),
        Sent("empty", "/v1/plans", b"", json_type if draw.random() < 0.5 else {}),
        Sent("at the limit", "/v1/plans", large, json_type),
        Sent("too large", "/v1/plans", too_large, json_type),
        Sent("chunked", "/v1/plans", body, json_type, chunks=int(draw.integers(1, 50))),
        Sent("too large, chunked", "/v1/plans", too_large, json_type, chunks=20),
        Sent("length", "/v1/plans", body, {**json_type, "Content-Length": length}),
        Sent("cut", "/v1/plans", body, json_type, cut=True),
        Sent("key", "/v1/plans", body, {**json_type, "Idempotency-Key": key}),
        Sent("condition", "/v1/plans", body, {**json_type, "If-None-Match": condition}),
        Sent("accept", "/v1/plans", body, {**json_type, "Accept": accept}),
        Sent("query", f"/v1/plans{steady}", body, json_type),
        Sent("head", "/v1/plans", body, {**json_type, "X-Y": "x" * 100_000}),
        Sent("header", "/v1/plans", body, {**json_type, "X-Request-ID": "\xff\x01"}),
    ]
    return choices[draw.integers(len(choices))]


BOMB = gzip.compress(bytes(50 * 2**20), mtime=0)

KINDS: list[tuple[float, Callable[[Draw, list[Tree], list[str]], Sent]]] = [
    (0.4, _scenario),
    (0.55, _extreme),
    (0.7, _job),
    (0.85, _rendition),
    (0.93, _wild),
    (1.0, _transport),
]
"""Kinds of requests, each with the share that it and those before it have."""
