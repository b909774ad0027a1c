"""Stand-in phones and a private adb server. A machine that cannot have them skips, and says why."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import adbutils
import pytest

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.errors import StandInUnavailableError
from agent_android.standin.phone import DESKTOP, StandInPhone
from phones.standin_helpers import attach


@pytest.fixture(scope="session")
def adb() -> Iterator[AdbServer]:
    with AdbServer() as server:
        yield server


@pytest.fixture
def desktop() -> Path:
    """What `app_process` hands its jar to; a test file may put its own in place."""
    return DESKTOP


@pytest.fixture
def phone(tmp_path: Path, desktop: Path) -> Iterator[StandInPhone]:
    with started(StandInPhone(tmp_path / "phone", desktop=desktop)) as one:
        yield one


@pytest.fixture
def other_phone(tmp_path: Path, desktop: Path) -> Iterator[StandInPhone]:
    with started(StandInPhone(tmp_path / "other-phone", desktop=desktop)) as one:
        yield one


def started(phone: StandInPhone) -> StandInPhone:
    try:
        return phone.start()
    except StandInUnavailableError as unavailable:
        pytest.skip(str(unavailable))


@pytest.fixture
def device(adb: AdbServer, phone: StandInPhone) -> Iterator[adbutils.AdbDevice]:
    yield attach(adb, phone)
    adb.client().disconnect(phone.serial)


@pytest.fixture
def other_device(adb: AdbServer, other_phone: StandInPhone) -> Iterator[adbutils.AdbDevice]:
    yield attach(adb, other_phone)
    adb.client().disconnect(other_phone.serial)
