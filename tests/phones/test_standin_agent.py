"""The agent as it ships, its jar by `app_process` and its APK by `am`, on a stand-in phone."""

from __future__ import annotations

import adbutils
import pytest

from agent_android import build
from agent_android.build_tools import OUT, BuildError
from agent_android.standin.phone import StandInPhone
from phones.standin_helpers import run, wait_until

PACKAGE = "org.rayfarm.agent"
RECORD_END = b"RAYDONE\0"


@pytest.fixture(scope="module")
def version() -> str:
    try:
        build.build_desktop()
    except BuildError as error:
        pytest.skip(str(error))
    return build.version()


def test_the_jar_runs_by_app_process(device: adbutils.AdbDevice, phone: StandInPhone, version: str) -> None:
    device.sync.push(OUT / "agent.jar", "/data/local/tmp/agent.jar")
    words = f"probe --version {version} --token T --out /data/local/tmp/record --deadline 60"
    main = "CLASSPATH=/data/local/tmp/agent.jar app_process / org.rayfarm.agent.Main"
    assert b"rayfarm done\n" in run(device, f"{main} {words}")
    assert (phone.local_tmp / "record").read_bytes()[-40:-32] == RECORD_END


def test_the_apk_runs_by_am(device: adbutils.AdbDevice, phone: StandInPhone, version: str) -> None:
    if not (OUT / "agent.apk").exists():
        pytest.skip("agent.apk is not built: aapt2, zipalign or apksigner is missing")
    device.sync.push(OUT / "agent.apk", "/data/local/tmp/agent.apk")
    assert run(device, "pm install -t /data/local/tmp/agent.apk; pm list packages").split() == [
        b"Success",
        f"package:{PACKAGE}".encode(),
    ]
    words = f"probe,--version,{version},--token,T,--out,record,--deadline,60"
    assert b"Status: ok" in run(device, f"am start -W -n {PACKAGE}/.AgentActivity --esa args {words}")
    record = phone.root / "data/data" / PACKAGE / "files/record"
    wait_until(record.exists)
    assert run(device, f"run-as {PACKAGE} cat files/record") == record.read_bytes()
    assert record.read_bytes()[-40:-32] == RECORD_END
    wait_until(lambda: phone.processes() == [])
    assert b"I/rayfarm: done\n" in run(device, "logcat -d")
    assert run(device, f"pm uninstall {PACKAGE}; ls /data/data /data/app") == b"Success\n/data/app:\n\n/data/data:\n"


def test_what_is_not_installed_is_refused(device: adbutils.AdbDevice) -> None:
    assert device.shell2(f"pm path {PACKAGE}", v2=True).returncode == 1
    assert f"unknown package: {PACKAGE}" in device.shell2(f"run-as {PACKAGE} true", v2=True).stderr
    assert "does not exist" in device.shell2(f"am start -n {PACKAGE}/.AgentActivity", v2=True).stdout
    assert device.shell2(f"pm uninstall {PACKAGE}", v2=True).stdout.startswith("Failure")
