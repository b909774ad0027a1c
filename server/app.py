"""The FastAPI application: API, pages, health."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import timedelta
from functools import partial

from fastapi import FastAPI, Request
from fastapi.responses import Response
from sqlalchemy.exc import SQLAlchemyError

from server import metrics, problems
from server.access.limits import Limit
from server.access.middleware import Access
from server.api import claims as api_claims
from server.api import compare as api_compare
from server.api import compiled as api_compiled
from server.api import devices as api_devices
from server.api import difference as api_difference
from server.api import events as api_events
from server.api import frames as api_frames
from server.api import hard_cases as api_hard_cases
from server.api import jobs as api
from server.api import pictures as api_pictures
from server.api import predictors as api_predictors
from server.api import profiles as api_profiles
from server.api import recommendations as api_recommendations
from server.api import schema
from server.api import studies as api_studies
from server.api import trace as api_trace
from server.api.idempotency import forget_submissions
from server.api.intake import Intake
from server.api.state import database_of
from server.dashboard import pages
from server.guard import Guard
from server.keeping.prune import Ages, prune
from server.live.feed import Feed
from server.problems import Problem
from server.queue.care import caring
from server.queue.durable import Durable
from server.settings import Settings
from server.store.blobs import Blobs
from server.store.database import Database


def create_app(settings: Settings) -> FastAPI:
    """The application on the settings' database, which it opens at start-up and closes at the end."""

    blobs = Blobs(settings.blobs)
    ages = Ages(_days(settings.keep_frames_days), _days(settings.keep_files_days))

    def tidy_up(database: Database) -> None:
        with database.writing() as session:
            forget_submissions(session)
        prune(database, blobs, ages)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        app.state.database = Database(settings.database_url)
        app.state.durable = Durable(app.state.database)
        app.state.feed = Feed(app.state.database)
        app.state.intake = Intake(app.state.database, app.state.durable)
        try:
            with caring(app.state.database, app.state.durable, settings.lease_s, partial(tidy_up, app.state.database)):
                yield
        finally:
            await app.state.feed.close()
            await app.state.intake.close()
            app.state.durable.close()
            app.state.database.close()

    app = FastAPI(title="RayFarm", lifespan=lifespan, openapi_url="/api/v1/openapi.json", docs_url=None, redoc_url=None)
    app.include_router(api.router)
    app.include_router(api_studies.router)
    app.include_router(api_claims.router)
    app.include_router(api_compare.router)
    app.include_router(api_compiled.router)
    app.include_router(api_difference.router)
    app.include_router(api_events.router)
    app.include_router(api_frames.router)
    app.include_router(api_devices.router)
    app.include_router(api_hard_cases.router)
    app.include_router(api_pictures.router)
    app.include_router(api_predictors.router)
    app.include_router(api_profiles.router)
    app.include_router(api_recommendations.router)
    app.include_router(api_trace.router)
    app.state.lease_s = settings.lease_s
    app.state.blobs, app.state.profile_mb = blobs, settings.profile_mb
    app.include_router(metrics.router)
    pages.install(app)
    problems.install(app)
    schema.install(app)
    app.add_middleware(Access, required=settings.require_tokens, limit=Limit(settings.submissions_per_minute))
    app.add_middleware(Guard, allowed_hosts=settings.allowed_hosts)

    @app.get("/livez", include_in_schema=False)
    def livez() -> Response:
        """The process answers."""
        return Response("ok\n", media_type="text/plain")

    @app.get("/readyz", include_in_schema=False)
    def readyz(request: Request) -> Response:
        """The database answers."""
        try:
            database_of(request).check()
        except SQLAlchemyError as error:
            raise Problem(503, "The database does not answer.") from error
        return Response("ok\n", media_type="text/plain")

    return app


def _days(number: int | None) -> timedelta | None:
    return None if number is None else timedelta(days=number)
