"""Follows the devices of one host for as long as its worker runs, and writes what it sees into the registry.

One thread coordinates: presence has one writer, so that events cannot overtake each other. Of several workers on a
host one tracks; another takes over when that one is gone.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from sqlalchemy.exc import SQLAlchemyError

from server.devices import registry, wanted
from server.devices.attach import AdbLinks, AttachError, Links
from server.devices.attendant import Attendant, Pace
from server.devices.children import Children
from server.devices.examiner import Examiner, PhoneExaminer, TwinExaminer
from server.devices.hotplug import ADB_ERRORS, Adb, AdbServer, States, Watcher
from server.devices.presence import note_states
from server.devices.registry import PAIRING, PHONE
from server.devices.turn import Turn
from server.devices.wanted import Retries, Row
from server.devices.words import WordError, plain, require_serial
from server.logs import facts
from server.store.database import Database

log = logging.getLogger("rayfarm.devices")

POLL_S = 2.0
"""How often the registry is asked, in one query, for phones to connect to."""
SETTLE_S = 0.05
"""adb's events come in bursts: so long they are gathered."""
PATIENCE_S = 5.0
LINKS = 4
NO_SERVER = "No adb server can be had on {}: install adb there, or see its worker's log."
PAIRED = "Paired: now attach the phone at the address that its page Wireless debugging shows."

MakeExaminer = Callable[[str], Examiner]


class Tracker:
    """Tracks the devices of `host_name`: its llvmpipe (`twin`), and phones over adb (`phones`)."""

    def __init__(
        self,
        database: Database,
        host_name: str,
        on_ready: Callable[[str], None],
        *,
        twin: bool = True,
        phones: bool = True,
        pace: Pace | None = None,
        adb: Adb | None = None,
        links: Links | None = None,
        examiner: MakeExaminer | None = None,
    ) -> None:
        """`on_ready` is told a device's id whenever jobs may run on it anew, in a thread of ours.

        Tests give their own `adb`, `links` and `examiner`.
        """
        self._database, self._host, self._on_ready = database, host_name, on_ready
        self._twin, self._phones, self._pace = twin, phones, pace or Pace()
        self._children = Children()
        self._make_examiner = examiner or self._examiner
        self._links = links or AdbLinks()
        self._watcher = Watcher(adb or AdbServer(), self._hear)
        self._turn = Turn(f"{database.engine.url} {host_name}")
        self._stop, self._wake = threading.Event(), threading.Event()
        self._heard = threading.Lock()
        self._states: States | None = {}
        self._gone: set[str] = set()
        self._dirty = False
        self._attendants: dict[str, Attendant] = {}
        self._retries = Retries()
        self._linked, self._dropped, self._busy = set[str](), set[str](), set[str]()
        self._pool = ThreadPoolExecutor(LINKS, thread_name_prefix="adb-link")
        self._thread = threading.Thread(target=self._run, name="device-tracker", daemon=True)

    def start(self) -> None:
        """Begin to track."""
        self._thread.start()

    def stop(self) -> None:
        """End, with all threads and children. The devices stay in the registry as they are."""
        self._stop.set()
        self._wake.set()
        self._children.end()
        if self._thread.ident is not None:
            self._thread.join()

    def _run(self) -> None:
        try:
            while not self._turn.take():
                if self._stop.wait(POLL_S):
                    return
            self._begin()
            while not self._stop.is_set():
                try:
                    self._step()
                except SQLAlchemyError as error:
                    log.warning("The registry of devices does not answer: %s", type(error).__name__)
                    self._dirty = True
                    self._stop.wait(POLL_S)
                self._wake.wait(POLL_S)
        except Exception:
            log.exception("the devices of this host are tracked no longer")
        finally:
            self._end()

    def _begin(self) -> None:
        if self._twin:
            self._see_twin()
        if self._phones:
            self._watcher.start()

    def _end(self) -> None:
        self._watcher.stop(PATIENCE_S)
        self._pool.shutdown(wait=False, cancel_futures=True)
        for attendant in self._attendants.values():
            attendant.leave()
        for attendant in self._attendants.values():
            attendant.join(PATIENCE_S)
        self._turn.give()

    def _see_twin(self) -> None:
        with self._database.writing() as session:
            registry.see_twin(session, self._host)
        self._arrive(registry.twin_id(self._host))

    # What adb tells

    def _hear(self, states: States | None, gone: set[str]) -> None:
        """The watcher's thread: keep the latest, and who was away in between."""
        with self._heard:
            self._states = None if states is None else {s: state for s, state in states.items() if _is_serial(s)}
            self._gone |= gone
            self._dirty = True
        self._wake.set()

    def _step(self) -> None:
        self._wake.clear()
        if self._phones:
            self._stop.wait(SETTLE_S if self._dirty else 0.0)
            rows = self._poll()
            self._drop({row.address for row in rows if row.address is not None and row.host == self._host})
            if self._dirty:
                self._note()
            self._serve(rows)

    def _note(self) -> None:
        with self._heard:
            heard, gone = self._states, self._gone
            self._gone, self._dirty = set(), False
        trouble = NO_SERVER.format(self._host) if heard is None else None
        states = {serial: state for serial, state in (heard or {}).items() if serial not in self._dropped}
        self._dropped &= (heard or {}).keys()
        with self._database.writing() as session:
            online = note_states(session, self._host, states, trouble)
        twin = registry.twin_id(self._host)
        for device_id in self._attendants.keys() - {twin}:
            if device_id not in online or device_id in gone:
                self._attendants[device_id].leave()
                log.info("device gone", extra=facts(device=device_id))
        for device_id in online:
            before = self._attendants.get(device_id)
            if before is None or before.left:
                self._arrive(device_id)

    def _arrive(self, device_id: str) -> None:
        before = self._attendants.get(device_id)
        examiner = self._make_examiner(device_id)
        attendant = Attendant(self._database, device_id, examiner, self._on_ready, self._pace, before)
        self._attendants[device_id] = attendant
        log.info("device here", extra=facts(device=device_id))
        attendant.start()

    def _examiner(self, device_id: str) -> Examiner:
        if device_id == registry.twin_id(self._host):
            return TwinExaminer(self._children)
        return PhoneExaminer(device_id, self._children)

    # What people ask

    def _poll(self) -> list[Row]:
        with self._database.reading() as session:
            rows = wanted.poll(session, self._host)
        if any(row.host is None for row in rows):
            with self._database.writing() as session:
                wanted.claim_unclaimed(session, self._host)
        return rows

    def _serve(self, rows: list[Row]) -> None:
        states = self._states
        mine = [row for row in rows if row.host == self._host]
        for row in mine:
            attendant = self._attendants.get(row.id)
            if attendant is not None and row.ready and not attendant.told:
                attendant.look()
            # Asked for while adb had it already: no event will come.
            if row.presence == "connecting" and row.kind == PHONE and row.id in (states or ()):
                self._dirty = True
        if states is not None:
            self._connect(mine, states)
        if any(row.kind == PAIRING for row in mine):
            self._pair()

    def _drop(self, addresses: set[str]) -> None:
        """Disconnect what nobody wants any more; what adb still lists of it is not seen as a phone of its own."""
        for address in self._linked - addresses:
            self._dropped.add(address)
            self._pool.submit(self._try, address, self._links.disconnect)
        self._dropped -= addresses
        self._linked = addresses

    def _connect(self, rows: list[Row], states: States) -> None:
        for address in self._retries.due(rows, states, time.monotonic(), self._busy):
            self._busy.add(address)
            self._pool.submit(self._try, address, self._links.connect)

    def _pair(self) -> None:
        with self._database.writing() as session:
            taken = wanted.take_pairings(session, self._host)
        for device_id, address, code in taken:
            self._pool.submit(self._try_pairing, device_id, address, code)

    def _try(self, address: str, work: Callable[[str], None]) -> None:
        sentence = _sentence(lambda: work(address))
        try:
            if sentence is not None:
                with self._database.writing() as session:
                    wanted.answer_attaching(session, address, sentence)
        except SQLAlchemyError:
            log.warning("%s could not be connected to, nor the registry told so", address)
        finally:
            self._busy.discard(address)

    def _try_pairing(self, device_id: str, address: str, code: str) -> None:
        sentence = _sentence(lambda: self._links.pair(address, code))
        try:
            with self._database.writing() as session:
                wanted.answer_pairing(session, device_id, sentence is None, sentence or PAIRED)
        except SQLAlchemyError:
            log.warning("the registry could not be told what came of a pairing")


def _sentence(work: Callable[[], None]) -> str | None:
    """What went wrong; None when nothing did."""
    try:
        work()
    except AttachError as error:
        return str(error)
    except ADB_ERRORS as error:
        return f"adb does not do it: {plain(error)}."
    return None


def _is_serial(text: str) -> bool:
    try:
        require_serial(text)
    except WordError as error:
        log.debug("%s", error)
        return False
    return True
