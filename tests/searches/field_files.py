"""Search for files of the field that break their import: each kind, with its bytes changed.

Fails where anything but an InputError of one line is raised, where the scenario of what was read is
not valid, and where a file takes more than five seconds of processor time or 500 MB.
"""

import re
import resource
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from syncplan.errors import InputError
from syncplan.importing.imported_places import import_places
from tests.importing.test_field_files import kmz
from tests.searches import Search

FILES = sorted(path for path in Path("tests/data/places").iterdir() if path.is_file())
KML = Path("tests/data/places/survey.kml").read_bytes()
PACKED = kmz(KML)
LONGEST_S, LARGEST_MB = 5.0, 500.0
TOKENS = (
    *(b"NaN", b"1e999", b"-1e308", b"999999999999999999999", b"1e-320", b"null", b"true", b'""'),
    *(b"<", b">", b"&#0;", b"&amp;", b"<!DOCTYPE a>", b"<![CDATA[", b"<Folder>" * 99, b"]" * 50),
    *(
        b"[" * 2000,
        b"{" * 2000,
        b'{"a":' * 500,
        b"\xff",
        b"\x00",
        b"\xef\xbb\xbf",
        b"\r",
        b"\n" * 99,
    ),
    *(b",", b";", b"\t", b" ", b"-", b"90.0001", b"180", b"-180", b"5001", b"5003", b"0 0 0"),
)


RING = b"<LinearRing><coordinates>8,47 8.1,47 8.1,47.1 8,47</coordinates></LinearRing>"
MARK = b"<Placemark>" + RING + b"</Placemark>"
HOSTILE: tuple[tuple[str, bytes], ...] = (
    ("blanks.kml", b"<kml><Point><coordinates>" + b" " * 10**6 + b"</coordinates></Point></kml>"),
    ("commas.kml", b"<kml>" + MARK.replace(b"8,47 ", b"," * 10**6) + b"</kml>"),
    (
        "folder.kml",
        b"<kml><Folder><name>" + b"x" * 10**5 + b"</name>" + MARK * 1000 + b"</Folder></kml>",
    ),
    ("elements.kml", b"<kml>" + b"<a/>" * 10**6 + b"</kml>"),
    ("columns.csv", b"a," * 10**6 + b"\n"),
    ("lines.txt", b"QGC WPL 110\n" + b"1\n" * 10**6),
    ("members.json", b'{"type":"FeatureCollection","features":[' + b"{}," * 10**6 + b"{}]}"),
    ("points.json", b'{"type":"MultiPoint","coordinates":[' + b"[1,1]," * 8 * 10**5 + b"[1,1]]}"),
)
"""Files that took long, or much memory, one for each of the first draws."""


def changed(content: bytes, generator: np.random.Generator) -> bytes:
    """Return bytes with some changes: parts repeated, taken out, exchanged, tokens put in."""
    for _ in range(int(generator.geometric(0.6))):
        first, last = np.sort(generator.integers(0, len(content) + 1, 2)).tolist()
        last = min(last, first + int(generator.integers(1, 400)))
        before, part, after = content[:first], content[first:last], content[last:]
        token = TOKENS[int(generator.integers(len(TOKENS)))]
        times = int(generator.choice([2, 10, 1000]))
        content = (
            before + part * times + after,
            before + after,
            before + token + after,
            before + part + token,
            before + after + part,
            before + bytes(generator.integers(0, 256, 4, dtype=np.uint8)) + after,
            *([before + re.sub(rb"[0-9]", b"%d" % generator.integers(10), part) + after] * 6),
        )[int(generator.integers(12))]
    return content[: 4 * 2**20]


def draw(number: int) -> tuple[list[str], tuple[float, float, tuple[str, ...]]]:
    """Return what a changed file of each kind breaks, the longest time in s, MB, and the ends."""
    faults, ends, longest, held = [], [], 0.0, _peak_mb()
    contents = [(path.name, path.read_bytes()) for path in FILES]
    contents += [("packed.kmz", PACKED), *HOSTILE[number : number + 1]]
    for kind, (name, content) in enumerate(contents):
        generator = np.random.default_rng([number, kind])
        again = content if content in dict(HOSTILE).values() else changed(content, generator)
        if content is PACKED and generator.uniform() < 0.5:
            again = kmz(changed(KML, generator))
        began = time.process_time()
        try:
            places = import_places({name: again})
            ends.append("read")
            places.scenario_text()
        except InputError as error:
            ends.append("refused")
            if "\n" in str(error):
                faults.append(f"{name}: more than a line: {error}")
        # whatever comes is the fault that is looked for
        except Exception as error:
            faults.append(f"{name}: {type(error).__name__}: {error}")
        longest = max(longest, time.process_time() - began)
    if longest > LONGEST_S:
        faults.append(f"took {longest:.1f} s")
    # what other searches held before in this process does not count
    memory = _peak_mb() - held
    if memory > LARGEST_MB:
        faults.append(f"held {memory:.0f} MB more")
    return faults, (longest, memory, tuple(ends))


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def judge(cases: Mapping[int, tuple[float, float, tuple[str, ...]]], _chance: float) -> list[str]:
    """Print how many files were read and refused, with the longest time and the most memory."""
    print(dict(Counter(end for *_, ends in cases.values() for end in ends)))
    longest, memory = (max(case[k] for case in cases.values()) for k in (0, 1))
    print(f"at most {longest:.2f} s and {memory:.0f} MB more; {_peak_mb():.0f} MB in all")
    return []


SEARCH = Search(draw, judge, draws=100)
