"""Ask a service, or a worker, on this machine whether it is ready; exit status 1 where it is not.

healthcheck.py [PORT]    SYNCPLAN_PORT, or 8000, if none is given
"""

import os
import sys
from urllib.request import ProxyHandler, build_opener

_TIMEOUT_S = 3.0

given = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("SYNCPLAN_PORT", "8000")
address = f"http://127.0.0.1:{given}/readyz"
try:
    # a proxy of the environment is not for this machine's own
    with build_opener(ProxyHandler({})).open(address, timeout=_TIMEOUT_S) as answer:
        sys.exit(answer.status != 200)
except OSError as error:
    # an answer of 503 says why
    reason = error.read().decode(errors="replace") if hasattr(error, "read") else error
    sys.exit(f"{address}: {reason}")
