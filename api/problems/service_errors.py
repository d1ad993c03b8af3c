"""The errors that routes raise on purpose; each is answered with a problem of its status."""

import math
from collections.abc import Mapping, Sequence

from api.problems.problem_document import FaultEntry, shown


class ServiceError(Exception):
    """A request that is not served: the status, why in one line, headers and faults to send."""

    def __init__(
        self,
        status: int,
        detail: str,
        *,
        headers: Mapping[str, str] | None = None,
        errors: Sequence[FaultEntry] = (),
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.headers = dict(headers or {})
        self.errors = tuple(errors)


class NotFound(ServiceError):
    """404: there is no such resource, or it is another owner's."""

    def __init__(self, detail: str) -> None:
        super().__init__(404, detail)


class Conflict(ServiceError):
    """409: the request does not fit the state of the resource."""

    def __init__(self, detail: str) -> None:
        super().__init__(409, detail)


class PreconditionFailed(ServiceError):
    """412: the resource is not the one that If-Match names."""

    def __init__(self, detail: str) -> None:
        super().__init__(412, detail)


class KeyReused(ServiceError):
    """422: an Idempotency-Key that was used for another request."""

    def __init__(
        self, detail: str = "this Idempotency-Key came with another request; take a new one"
    ) -> None:
        super().__init__(422, detail)


class TooMuchWork(ServiceError):
    """422: the request is sound, but beyond a limit of this service, `path` the key at fault."""

    def __init__(self, detail: str, *, path: str = "", value: object = None) -> None:
        super().__init__(
            422, detail, errors=[FaultEntry(path=path, value=shown(value), message=detail)]
        )


class Unauthorized(ServiceError):
    """401: no key, or one that is not known."""

    def __init__(self, detail: str = "send a known key as 'Authorization: Bearer KEY'") -> None:
        super().__init__(401, detail, headers={"WWW-Authenticate": "Bearer"})


class TooManyRequests(ServiceError):
    """429: the owner has as much in work as allowed; try again after `retry_after_s`."""

    def __init__(self, detail: str, *, retry_after_s: float) -> None:
        super().__init__(429, detail, headers=_retry_after(retry_after_s))


class KeysThrottled(TooManyRequests):
    """429: the address has presented too many wrong keys."""


class WrongHost(ServiceError):
    """421: a service without keys does not answer under this name."""

    def __init__(self, detail: str) -> None:
        super().__init__(421, detail)


class ForeignPage(ServiceError):
    """403: a service without keys is not for another's page to ask."""

    def __init__(self, detail: str) -> None:
        super().__init__(403, detail)


class Unavailable(ServiceError):
    """503: the service can't answer now; try again after `retry_after_s`."""

    def __init__(self, detail: str, *, retry_after_s: float = 2.0) -> None:
        super().__init__(503, detail, headers=_retry_after(retry_after_s))


class StorageFull(ServiceError):
    """507: nothing more can be stored until the operator makes room."""

    def __init__(self, detail: str = "the storage is full; nothing was stored") -> None:
        super().__init__(507, detail)


def _retry_after(seconds: float) -> dict[str, str]:
    return {"Retry-After": str(max(1, math.ceil(seconds)))}
