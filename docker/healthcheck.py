"""Ask the service on this machine for a sign of life; exit status 1 where there is none."""

import os
import sys
from urllib.request import ProxyHandler, build_opener

_TIMEOUT_S = 3.0

address = f"http://127.0.0.1:{os.environ.get('SYNCPLAN_PORT', '8000')}/healthz"
try:
    # a proxy of the environment is not for this machine's own
    with build_opener(ProxyHandler({})).open(address, timeout=_TIMEOUT_S) as answer:
        sys.exit(answer.status != 200)
except OSError as error:
    sys.exit(f"{address}: {error}")
