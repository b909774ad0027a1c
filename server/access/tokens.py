"""API tokens `id.secret` and the sessions of pages, which are tokens made from one: stored hashed, expiring.

A secret is 256 random bits, so one round of SHA-256 suffices: a slow hash protects what can be guessed.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from server.access.scopes import SCOPES, Scope
from server.store.database import Database
from server.store.models import Token, now

MAX_NAME = 100
SESSION = timedelta(hours=12)
_SHAPE = re.compile(r"([0-9a-f]{12})\.([A-Za-z0-9_-]{43})")
_NOBODY = hashlib.sha256(b"nobody").hexdigest()


class TokenError(ValueError):
    """A token that cannot be made or is not there; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class Holder:
    """Who sent a request: a token's id and scopes; `session` is the session's id where a page sent it."""

    id: str
    scopes: tuple[Scope, ...]
    session: str | None = None


def create(session: Session, name: str, scopes: Sequence[str], valid: timedelta) -> tuple[Token, str]:
    """Make a token; return it, and its text, which is nowhere else from now on. Raise TokenError for bad ones."""
    unknown = next((scope for scope in scopes if scope not in SCOPES), None)
    if unknown is not None or not scopes:
        said = f"Unknown scope {unknown[:40]!r}" if unknown else "A token needs a scope"
        raise TokenError(f"{said}: choose from {', '.join(SCOPES)}.")
    if not name.strip() or len(name) > MAX_NAME or not name.isprintable():
        raise TokenError(f"A token needs a name of 1 to {MAX_NAME} printable characters: say whose it is.")
    return _add(session, name.strip(), [scope for scope in SCOPES if scope in scopes], now() + valid, None)


def find(database: Database, text: str) -> Holder | None:
    """The holder of a token's text; None unless it is known, not revoked and not expired.

    The hash is compared in constant time, and for an unknown id as well.
    """
    shape = _SHAPE.fullmatch(text)
    with database.reading() as session:
        token = session.get(Token, shape[1]) if shape else None
        parent = session.get(Token, token.parent) if token and token.parent else None
    same = hmac.compare_digest(_digest(shape[2] if shape else text), token.digest if token else _NOBODY)
    if token is None or not same or not _is_live(token) or (token.parent and not (parent and _is_live(parent))):
        return None
    known = tuple(scope for scope in SCOPES if scope in token.scopes)
    return Holder(token.parent or token.id, known, token.id if token.parent else None)


def still_good(database: Database, holder: Holder) -> bool:
    """Whether a holder that was found earlier would be found now."""
    with database.reading() as session:
        found = [session.get(Token, key) for key in (holder.id, holder.session) if key]
    return all(token is not None and _is_live(token) for token in found)


def begin_session(database: Database, text: str) -> str | None:
    """Exchange a token's text for a session's; None when the token is not good. A session cannot make another."""
    holder = find(database, text)
    if holder is None or holder.session is not None:
        return None
    with database.writing() as session:
        parent = session.get_one(Token, holder.id)
        session.execute(delete(Token).where(Token.parent.is_not(None), Token.expires_at < now()))
        _, made = _add(session, parent.name, parent.scopes, min(now() + SESSION, parent.expires_at), parent.id)
    return made


def end_session(database: Database, text: str) -> None:
    """End a session; nothing where there is none."""
    holder = find(database, text)
    if holder is not None and holder.session is not None:
        with database.writing() as session:
            session.execute(delete(Token).where(Token.id == holder.session))


def revoke(session: Session, token_id: str) -> Token:
    """Revoke a token and with it its sessions; raise TokenError when there is none."""
    token = session.get(Token, token_id[:40])
    if token is None or token.parent is not None:
        raise TokenError(f"There is no token {token_id[:40]!r}: `rayfarm tokens list` shows those that exist.")
    token.revoked_at = token.revoked_at or now()
    return token


def list_tokens(session: Session) -> list[Token]:
    """All tokens that people made, the oldest first."""
    return list(session.scalars(select(Token).where(Token.parent.is_(None)).order_by(Token.created_at, Token.id)))


def any_live(database: Database) -> bool:
    """Whether anybody could come in."""
    live = select(Token.id).where(Token.parent.is_(None), Token.revoked_at.is_(None), Token.expires_at > now())
    with database.reading() as session:
        return session.execute(live.limit(1)).first() is not None


def state_of(token: Token) -> str:
    """`good`, `expired` or `revoked`."""
    return "revoked" if token.revoked_at else "good" if _is_live(token) else "expired"


def _add(
    session: Session, name: str, scopes: Sequence[str], expires_at: datetime, parent: str | None
) -> tuple[Token, str]:
    key, secret = secrets.token_hex(6), secrets.token_urlsafe(32)
    token = Token(id=key, name=name, digest=_digest(secret), scopes=list(scopes), expires_at=expires_at, parent=parent)
    session.add(token)
    session.flush()
    return token, f"{key}.{secret}"


def _is_live(token: Token) -> bool:
    return token.revoked_at is None and token.expires_at > now()


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
