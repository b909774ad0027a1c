"""How a claimed slice is measured: which child does it, for which device, and where its pictures go."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from renderer.child import AsyncSay, run_child_async
from renderer.phone_compile.task import MODULE, task_of
from server.compiled.kept import keep_listing
from server.devices.registry import PHONE
from server.pictures.taken import take_up
from server.queue import ledger
from server.queue.ledger import Claim
from server.recommendations import asked_of
from server.settings import Settings
from server.store.blobs import Blobs
from server.store.database import Database
from server.store.errors import AWAY
from server.store.models import Device, Json

AGENT_SHARE = 0.8
"""The part of a slice's time limit that one command of a phone's agent may take: it ends by itself, and says why."""

RECOMMENDATION_SLICES = 8
"""A recommendation, which holds its device as one slice, may take as long as so many."""


class SliceRunner:
    """Runs slices in leashed children.

    A child ends when `has_lease` has been false for half of the lease: before anybody takes its worker for dead.
    """

    def __init__(self, database: Database, settings: Settings, has_lease: Callable[[], bool]) -> None:
        self.database, self.settings, self.has_lease = database, settings, has_lease
        self.blobs = Blobs(settings.blobs)

    async def __call__(self, held: Claim, say: AsyncSay) -> Json:
        """Measure one slice, or find a recommendation; the first round's pictures are blobs when this returns."""
        if (query := asked_of(held.request)) is not None:
            return await self._recommend(held, query, say)
        if held.round != 0:
            return await self._measure(held, say, None)
        with tempfile.TemporaryDirectory(prefix="rayfarm-pictures-", ignore_cleanup_errors=True) as name:
            folder = Path(name)
            measurement = await self._measure(held, say, folder)
            if held.request.get("gpus"):
                return await asyncio.to_thread(keep_listing, measurement, self.blobs)
            return await asyncio.to_thread(take_up, measurement, folder, self.blobs)

    async def _recommend(self, held: Claim, query: Json, say: AsyncSay) -> Json:
        task: Json = {"query": query}
        module = "renderer.recommend.task"
        if self._is_phone(held.device):
            module = "server.devices.phone_recommending"
            deadline_s = self.settings.slice_timeout_s * AGENT_SHARE
            task |= {"serial": held.device, "via": self.settings.via, "deadline_s": deadline_s}
        return await run_child_async(
            module,
            task,
            held.request.get("threads", 1),
            self.settings.slice_timeout_s * RECOMMENDATION_SLICES,
            say,
            note=self._noting(held),
            lease_s=self.settings.lease_s / 2,
            has_lease=self.has_lease,
            memory_mb=self.settings.slice_memory_mb,
        )

    async def _measure(self, held: Claim, say: AsyncSay, pictures: Path | None) -> Json:
        limit_s, lease_s = self.settings.slice_timeout_s, self.settings.lease_s
        task: Json = {"request": held.request, "round": held.round}
        if pictures is not None:
            task["pictures"] = str(pictures)
        module = "renderer.slice"
        if held.request.get("gpus"):
            module, task = MODULE, task_of(held.request, held.request["gpus"], disassembly=True)
        elif self._is_phone(held.device):
            module = "server.devices.phone_slice"
            task |= {"serial": held.device, "via": self.settings.via, "deadline_s": limit_s * AGENT_SHARE}
        return await run_child_async(
            module,
            task,
            held.request.get("threads", 1),
            limit_s,
            say,
            note=self._noting(held),
            lease_s=lease_s / 2,
            has_lease=self.has_lease,
            memory_mb=self.settings.slice_memory_mb,
        )

    def _noting(self, held: Claim) -> AsyncSay:
        """What a child notes goes into its job's history, or nowhere while the database is away."""

        async def note(text: str) -> None:
            with suppress(*AWAY):
                await asyncio.to_thread(ledger.note, self.database, held, text)

        return note

    def _is_phone(self, device: str) -> bool:
        with self.database.reading() as session:
            row = session.get(Device, device)
            return row is not None and row.kind == PHONE
