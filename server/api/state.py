"""What an application keeps open for its requests."""

from __future__ import annotations

from fastapi import Request

from server.queue.durable import Durable
from server.store.database import Database


def database_of(request: Request) -> Database:
    """The database of the app that a request came to."""
    database = request.app.state.database
    assert isinstance(database, Database)
    return database


def durable_of(request: Request) -> Durable:
    """The queue of the app that a request came to."""
    durable = request.app.state.durable
    assert isinstance(durable, Durable)
    return durable
