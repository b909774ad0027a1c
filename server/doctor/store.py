"""The database, its tables' version, and the tokens in it."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from ipaddress import ip_address

from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Engine, select
from sqlalchemy.orm import Session

from server.doctor.finding import Said
from server.doctor.opening import opened
from server.settings import settings
from server.store.database import MIGRATIONS
from server.store.errors import shown
from server.store.models import Token, now

SOON = timedelta(days=14)
MAKE = "`rayfarm tokens create NAME --scope admin`"


def database() -> Iterator[Said]:
    """Whether the database answers and its tables are this program's."""
    newest = _script().get_current_head()
    with opened() as (engine, said):
        if engine is None:
            yield said
            return
        name, found = shown(engine.url), _revision(engine)
    if found is None:
        yield "good", f"{name} is empty: the first start makes its tables."
    elif found == newest:
        yield "good", f"{name} answers, its tables at {found}."
    elif found in {each.revision for each in _script().walk_revisions()}:
        versions = f"has the tables of {found}, this program those of {newest}"
        yield "note", f"{name} {versions}: keep a copy, then start the server, which brings them up to date."
    else:
        yield "missing", f"{name} was written by a later RayFarm (its tables are at {found}): update this one."


def tokens() -> Iterator[Said]:
    """Whether those who need a token have one."""
    chosen = settings()
    wanted = chosen.require_tokens or not _is_loopback(chosen.host)
    with opened() as (engine, _):
        current = engine is not None and _revision(engine) == _script().get_current_head()
        live = _live(engine) if engine is not None and current else []
    if live:
        yield "good", f"Tokens that are good: {len(live)}."
    elif wanted:
        why = "RAYFARM_REQUIRE_TOKENS" if chosen.require_tokens else f"RAYFARM_HOST is {chosen.host}"
        yield "missing", f"The server will ask for tokens ({why}) and there are none: make one with {MAKE}."
    else:
        yield "good", f"At {chosen.host} no token is needed."
    for name, expires_at in live:
        if expires_at < now() + SOON:
            yield "note", f"The token of {name} expires on {expires_at:%Y-%m-%d}: make another with {MAKE}."


def _script() -> ScriptDirectory:
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    return ScriptDirectory.from_config(config)


def _revision(engine: Engine) -> str | None:
    with engine.connect() as connection:
        return MigrationContext.configure(connection).get_current_revision()


def _live(engine: Engine) -> list[tuple[str, datetime]]:
    live = Token.parent.is_(None), Token.revoked_at.is_(None), Token.expires_at > now()
    with Session(engine) as session:
        return [(name, at) for name, at in session.execute(select(Token.name, Token.expires_at).where(*live))]


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"
