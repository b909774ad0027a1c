"""`Idempotency-Key`: a submission that is sent twice is taken once (draft-ietf-httpapi-idempotency-key-header)."""

from __future__ import annotations

import hashlib
import logging
import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from typing import Annotated

from fastapi import Depends, Header, Request
from fastapi.responses import JSONResponse
from sqlalchemy import delete
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from server.access.middleware import HOLDER
from server.logs import facts
from server.problems import Problem
from server.store.database import Database
from server.store.models import Json, Submitted, now

log = logging.getLogger("rayfarm.api")

HEADER = "Idempotency-Key"
REPLAYED = "Idempotent-Replayed"
KEPT = timedelta(hours=24)
NAMES = {"jobs": "job", "recommendations": "job", "studies": "study"}
"""What a log calls the number at the end of a location."""
_KEY = re.compile(r"[!-~]{1,200}")

KeyHeader = Annotated[str | None, Header(alias=HEADER, description="A request with the same key is taken once a day.")]


@dataclass(frozen=True)
class Submission:
    """A request that creates something: its key, if any, a digest of method, path and body, and the sender's token."""

    key: str | None
    digest: str
    owner: str = ""

    @property
    def kept_as(self) -> str | None:
        """The key as it is stored, if any: every token has keys of its own."""
        if self.key is None or not self.owner:
            return self.key
        return hashlib.sha256(f"{self.owner} {self.key}".encode()).hexdigest()


@dataclass(frozen=True)
class Answer:
    """What a submission is answered with, and where what it created is."""

    body: Json
    location: str
    status: int = 201

    def response(self, **headers: str) -> JSONResponse:
        """The response."""
        return JSONResponse(self.body, self.status, {"Location": self.location, **headers})


async def read_submission(request: Request, key: KeyHeader = None) -> Submission:
    """A request's submission; raise Problem 422 when its key cannot be one."""
    if len(request.headers.getlist(HEADER)) > 1 or (key is not None and not _KEY.fullmatch(key)):
        raise Problem(422, f"The {HEADER} is wrong: send one of 1 to 200 visible ASCII characters without spaces.")
    head = f"{request.method} {request.url.path}\n".encode()
    holder = request.scope.get(HOLDER)
    return Submission(key, hashlib.sha256(head + await request.body()).hexdigest(), holder.id if holder else "")


SubmissionOf = Annotated[Submission, Depends(read_submission)]


def earlier_answer(database: Database, submission: Submission) -> JSONResponse | None:
    """The answer that the key got in the last 24 hours, or None; raise Problem 422 for another request's key."""
    if submission.key is None:
        return None
    with database.reading() as session:
        return _given_again(session.get(Submitted, submission.kept_as), submission)


def answer_once(database: Database, submission: Submission, create: Callable[[Session], Answer]) -> JSONResponse:
    """Create and answer, both kept in one transaction, or give the answer that the key got in the last 24 hours.

    Of several at once with the same key one creates. Raise Problem 422 for another request's key.
    """
    try:
        with database.writing() as session:
            stored = session.get(Submitted, submission.kept_as) if submission.key is not None else None
            earlier = _given_again(stored, submission)
            if earlier is not None:
                return earlier
            if stored is not None:
                forget_submissions(session)
            answer = create(session)
            keep(session, submission, answer)
    except IntegrityError:
        earlier = earlier_answer(database, submission)
        if earlier is None:
            raise
        return earlier
    return log_accepted(answer, submission)


def log_accepted(answer: Answer, submission: Submission) -> JSONResponse:
    """The response to a submission that was accepted just now, which is logged."""
    kind, number = answer.location.rsplit("/", 2)[1:]
    log.info("%s accepted", kind, extra=facts(**{NAMES[kind]: int(number)}, token=submission.owner or None))
    return answer.response()


def _given_again(stored: Submitted | None, submission: Submission) -> JSONResponse | None:
    """A stored answer as a response; None where it is too old."""
    if stored is None or stored.created_at < now() - KEPT:
        return None
    if stored.digest != submission.digest:
        raise Problem(
            422, f"The {HEADER} {submission.key!r} was used with another request: send this one with a key of its own."
        )
    return Answer(stored.body, stored.location, stored.status).response(**{REPLAYED: "true"})


def forget_submissions(session: Session) -> None:
    """Delete the answers that are too old to be given again."""
    session.execute(delete(Submitted).where(Submitted.created_at < now() - KEPT))


def keep(session: Session, submission: Submission, answer: Answer) -> None:
    """Keep the answer to a submission that came with a key."""
    if submission.key is not None:
        kept = {"status": answer.status, "location": answer.location, "body": answer.body}
        session.add(Submitted(key=submission.kept_as, digest=submission.digest, **kept))
