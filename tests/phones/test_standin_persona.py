"""What a stand-in phone says of itself, also when that is hostile, and changes while it runs."""

from __future__ import annotations

import adbutils
import pytest

from agent_android.standin.phone import StandInPhone
from phones.standin_helpers import run

HOSTILE = [
    "$(touch /data/local/tmp/owned) `reboot` ; rm -rf / & | > < * ? [a] ~ !",
    "<script>alert(1)</script><img src=x onerror=alert(1)>&amp;\"'",
    '=cmd|"/C calc"!A0,\t"a""b",\r;@SUM(1+1)',
    "line one\nline two\\n %s %n \x1b[31m\x07",
    "Ünï \u202e\u2028 \U0001f4f1 \udcff\udcfe",
    "",
]


@pytest.mark.parametrize("model", HOSTILE, ids=["shell", "html", "csv", "terminal", "unicode-and-not", "empty"])
def test_a_hostile_model_name_arrives_byte_for_byte(
    device: adbutils.AdbDevice, phone: StandInPhone, model: str
) -> None:
    phone.persona.set_model(model)
    assert run(device, "getprop ro.product.model") == model.encode("utf-8", "surrogateescape") + b"\n"
    assert not (phone.local_tmp / "owned").exists()


def test_properties(device: adbutils.AdbDevice) -> None:
    assert run(device, "getprop ro.build.version.sdk") == b"34\n"
    assert run(device, "getprop no.such") == b"\n"
    assert run(device, "getprop no.such fallback") == b"fallback\n"
    assert b"[ro.product.model]: [Stand-in]\n" in run(device, "getprop")


def test_battery_and_temperature_change_while_running(device: adbutils.AdbDevice, phone: StandInPhone) -> None:
    assert b"  level: 87\n" in run(device, "dumpsys battery")
    phone.persona.set_battery(level=4, celsius=44.5, plugged=False)
    battery = run(device, "dumpsys battery")
    assert b"  level: 4\n" in battery
    assert b"  temperature: 445\n" in battery
    assert b"  USB powered: false\n" in battery
    assert run(device, "cat /sys/class/power_supply/battery/temp") == b"445\n"


def test_throttling_changes_while_running(device: adbutils.AdbDevice, phone: StandInPhone) -> None:
    assert b"Thermal Status: 0\n" in run(device, "dumpsys thermalservice")
    phone.persona.set_thermal(3)
    assert b"Thermal Status: 3\n" in run(device, "dumpsys thermalservice")
    with pytest.raises(ValueError, match="thermal status 7"):
        phone.persona.set_thermal(7)


def test_services(device: adbutils.AdbDevice) -> None:
    assert run(device, "dumpsys SurfaceFlinger | grep GLES") == b"GLES: Mesa, llvmpipe, OpenGL ES 3.1\n"
    assert run(device, "dumpsys gpu --gpuwork") == b"Can't find service: gpu\n"


def test_counters_come_change_and_go(device: adbutils.AdbDevice, phone: StandInPhone) -> None:
    assert run(device, "cat /sys/class/kgsl/kgsl-3d0/gpuclk") == b"585000000\n"
    phone.persona.set_counter("kgsl/kgsl-3d0/gpuclk", "257000000")
    assert run(device, "cat /sys/class/kgsl/kgsl-3d0/gpuclk") == b"257000000\n"
    phone.persona.set_counter("kgsl/kgsl-3d0/gpuclk", None)
    assert device.shell2("cat /sys/class/kgsl/kgsl-3d0/gpuclk", v2=True).returncode == 1


def test_settings_and_screen(device: adbutils.AdbDevice, phone: StandInPhone) -> None:
    assert run(device, "settings get global stay_on_while_plugged_in") == b"null\n"
    run(device, "svc power stayon usb; settings put system screen_brightness '1 2'; input keyevent KEYCODE_WAKEUP")
    assert (
        run(device, "settings get global stay_on_while_plugged_in; settings list system")
        == b"2\nscreen_brightness=1 2\n"
    )
    assert phone.setting("global", "stay_on_while_plugged_in") == "2"
    assert run(device, "dumpsys power") == b"mWakefulness=Awake\n"
    run(device, "settings delete system screen_brightness; input keyevent 223")
    assert phone.setting("system", "screen_brightness") is None
    assert run(device, "dumpsys power") == b"mWakefulness=Asleep\n"


def test_a_log_of_megabytes(device: adbutils.AdbDevice, phone: StandInPhone) -> None:
    assert run(device, "logcat -d") == b""
    phone.persona.set_logcat("<b>\x1b[0m,=\n" * 300_000)
    assert len(run(device, "logcat -d")) == 3_000_000


def test_an_environment_of_several_lines_is_refused(phone: StandInPhone) -> None:
    with pytest.raises(ValueError, match="one line"):
        phone.persona.set_environment(TRAP="a\nPATH=/")
