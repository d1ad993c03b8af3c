"""The answer that sends a job's events as they happen."""

from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from api.following.followed_job import Follower
from api.following.job_watch import JobWatch

_HEADERS = {"cache-control": "no-cache", "x-accel-buffering": "no"}
"""No store between here and the client keeps events back."""


class EventStream(StreamingResponse):
    """A stream that has its place among the followers for as long as it is sent.

    Raises TooManyRequests, before it begins to answer, where the owner has too many of them.
    """

    def __init__(self, watch: JobWatch, follower: Follower) -> None:
        super().__init__(watch.events(follower), headers=_HEADERS, media_type="text/event-stream")
        self._watch = watch
        self._follower = follower

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the stream until the job, the client or the server has ended."""
        with self._watch.following(self._follower):
            await super().__call__(scope, receive, send)
