"""File descriptors: as many as this process may have."""

import sys

_ENOUGH = 65_536
"""Far above what any limit of the service needs; some systems allow a thousand million."""
_UNKNOWN = 1024


def raise_limit() -> int:
    """Raise the limit of open files as far as the system lets this process; return what it is."""
    if sys.platform == "win32":
        return _UNKNOWN
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _ENOUGH if hard == resource.RLIM_INFINITY else min(hard, _ENOUGH)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        return wanted
    return _ENOUGH if soft == resource.RLIM_INFINITY else soft
