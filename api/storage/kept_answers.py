"""Answers given to requests with an Idempotency-Key, so that a repeated request gets the same."""

import json
from dataclasses import dataclass

from sqlalchemy import Connection, delete, insert, select
from sqlalchemy.exc import IntegrityError

from api.storage.clock import NOW
from api.storage.tables import answers


class AnswerTakenError(Exception):
    """Another request with the same key was answered in the meantime."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A response as it was given; `request_digest` identifies the request it answered."""

    request_digest: str
    status: int
    headers: dict[str, str]
    body: str


def find_answer(connection: Connection, owner: str, key: str) -> Answer | None:
    """Return the answer given to an owner's key, or None."""
    found = connection.execute(
        select(answers.c.request_digest, answers.c.status, answers.c.headers, answers.c.body).where(
            answers.c.owner == owner, answers.c.key == key
        )
    ).first()
    return None if found is None else Answer(found[0], found[1], json.loads(found[2]), found[3])


def keep_answer(connection: Connection, owner: str, key: str, answer: Answer) -> None:
    """Keep an answer; raises AnswerTakenError if there is one for the key already."""
    try:
        connection.execute(
            insert(answers).values(
                owner=owner,
                key=key,
                request_digest=answer.request_digest,
                status=answer.status,
                headers=json.dumps(answer.headers),
                body=answer.body,
                created_at=NOW,
            )
        )
    except IntegrityError:
        raise AnswerTakenError from None


def forget_answers(connection: Connection, older_than: str) -> None:
    """Delete answers given before a time."""
    connection.execute(delete(answers).where(answers.c.created_at < older_than))
