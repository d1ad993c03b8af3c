"""Who asks for something to be computed; it is computed in turn, on time and while they wait."""

import asyncio
import logging
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Depends, Request
from starlette.requests import ClientDisconnect

from api.computing.child import ChildGoneError, OutOfMemoryError, TooSlowError
from api.computing.tickets import GivenUpError, OwnerBusyError, PoolFullError, Ticket
from api.problems import TooManyRequests, TooMuchWork, Unavailable
from api.security import CurrentOwner
from api.service import CurrentService, Service

_RETRY_AFTER_S = 2.0

_logger = logging.getLogger("syncplan.calls")


@dataclass(frozen=True, slots=True)
class Caller:
    """An owner, and the request whose client waits for an answer."""

    service: Service
    owner: str
    request: Request


async def _caller(request: Request, service: CurrentService, owner: CurrentOwner) -> Caller:
    return Caller(service, owner, request)


CurrentCaller = Annotated[Caller, Depends(_caller)]
"""Parameter type of a route that has something computed."""


async def computed(caller: Caller, task: str, *arguments: Any) -> Any:
    """Return what a task in a child process returns, or raise the problem it has.

    The time limit counts from here, the wait for a process included. The body of the request must
    have been read, if there is one. Raises ClientDisconnect once the client has gone: the task is
    then given up.
    """
    settings = caller.service.settings
    limit = settings.plan_timeout_s
    try:
        ticket = caller.service.pool.submit(task, *arguments, owner=caller.owner, deadline_s=limit)
        return await _while_present(caller.request, ticket)
    except OwnerBusyError:
        raise TooManyRequests(
            f"you have {settings.max_requests} requests in work, the most allowed; wait until one "
            "is answered",
            retry_after_s=_RETRY_AFTER_S,
        ) from None
    except PoolFullError:
        raise Unavailable("too many requests are being computed; try again") from None
    except GivenUpError:
        raise Unavailable("the service is closing; try again") from None
    except TooSlowError:
        raise TooMuchWork(
            f"takes longer than the {limit:g} s a request may; ask for fewer vehicles or samples"
        ) from None
    except OutOfMemoryError:
        raise TooMuchWork(
            f"needs more than the {settings.task_memory / 2**20:.0f} MiB of memory a request may "
            "use; ask for fewer vehicles or samples"
        ) from None
    except ChildGoneError as error:
        _logger.error("the process computing %s ended twice: %s", task, error)
        raise TooMuchWork(
            "can't be computed: its process ended twice; ask for fewer vehicles or samples"
        ) from None


async def _while_present(request: Request, ticket: Ticket) -> Any:
    """Return a task's result; raises ClientDisconnect, and gives the task up, if nobody waits."""
    answer = asyncio.wrap_future(ticket.future)
    gone = asyncio.create_task(_gone(request))
    try:
        await asyncio.wait({answer, gone}, return_when=asyncio.FIRST_COMPLETED)
        if not answer.done():
            gone.result()
            raise ClientDisconnect
        return answer.result()
    finally:
        gone.cancel()
        # gives the task up if it is not done
        answer.cancel()


async def _gone(request: Request) -> None:
    """Return once the client has gone; what is left of a body that nobody read is dropped."""
    while (await request.receive())["type"] != "http.disconnect":
        pass
