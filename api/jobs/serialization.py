"""Rows of the queue hold JSON. Whatever claims to be anything else is refused, never read.

DBOS reads a row in the way that the row names, pickles among them, and reading a pickle runs what
it says: whoever can write to the table would run commands in every server and worker.
"""

import base64
import pickle
from typing import Any, NoReturn

from dbos import DBOSPortableJSONSerializer, Serializer

# not public: `refuse_pickles` sees whether they still mean what they did
from dbos._serialization import DefaultSerializer, deserialize_value

JSON_ROWS: Serializer = DBOSPortableJSONSerializer()
"""How rows are written."""


class RefusedRowError(ValueError):
    """A row of the queue holds something other than JSON."""


def refuse_pickles() -> None:
    """From now on, in this process, let DBOS raise RefusedRowError where a row holds a pickle.

    Raises RuntimeError if DBOS reads it nevertheless, as another version of it might.
    """
    DefaultSerializer.deserialize = _refuse  # type: ignore[assignment, method-assign]
    harmless = base64.b64encode(pickle.dumps("harmless")).decode()
    try:
        deserialize_value(harmless, DefaultSerializer().name(), JSON_ROWS)
    except RefusedRowError:
        return
    raise RuntimeError("this version of DBOS reads pickles from rows; install the one locked")


def _refuse(_serializer: DefaultSerializer, _serialized: Any) -> NoReturn:
    raise RefusedRowError("the row holds a pickle, which is not read")
