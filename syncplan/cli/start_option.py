"""Where the robots of a recording start, from an option: a file, or numbers."""

from pathlib import Path

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError

LARGEST_FILE_BYTES = 2**20


def poses_of(text: str) -> Array:
    """Return (n, 3) m, m, rad from `1,2,0.5;4,0,-1`, or from a file with a line for each robot.

    Raises InputError where that is no such list, and no such file.
    """
    rows = text.split(";") if ";" in text or "," in text else _lines(Path(text))
    poses = []
    for row in rows:
        try:
            x, y, heading = (float(word) for word in row.replace(",", " ").split())
        except ValueError:
            problem = (
                f"{row.strip()[:60]!r}: x, y and heading of one robot are needed, in m and rad"
            )
            raise InputError(problem, key="start_poses") from None
        poses.append((x, y, heading))
    return np.array(poses)


def _lines(path: Path) -> list[str]:
    try:
        if path.stat().st_size > LARGEST_FILE_BYTES:
            raise InputError(f"{path} is larger than a list of poses can be", key="start_poses")
        lines = path.read_text("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{path} is not a text file", key="start_poses") from None
    except OSError as error:
        raise InputError(f"{path} can't be read: {error.strerror}", key="start_poses") from None
    return [line for line in (line.split("#")[0].strip() for line in lines) if line]
