"""What a stand-in phone says of itself: files that its programs read at each call, so they may change at any time."""

from __future__ import annotations

import os
from pathlib import Path

PROPERTIES = {
    "ro.product.manufacturer": "RayFarm",
    "ro.product.brand": "rayfarm",
    "ro.product.model": "Stand-in",
    "ro.product.device": "standin",
    "ro.product.name": "standin",
    "ro.product.cpu.abi": "x86_64",
    "ro.soc.manufacturer": "Mesa",
    "ro.soc.model": "llvmpipe",
    "ro.board.platform": "llvmpipe",
    "ro.hardware": "standin",
    "ro.hardware.egl": "mesa",
    "ro.opengles.version": "196609",
    "ro.build.version.release": "14",
    "ro.build.version.sdk": "34",
    "ro.build.fingerprint": "rayfarm/standin/standin:14/STANDIN/1:userdebug/test-keys",
    "sys.boot_completed": "1",
}
COUNTERS = {
    "kgsl/kgsl-3d0/gpuclk": "585000000",
    "kgsl/kgsl-3d0/gpubusy": "  120000  1000000",
    "kgsl/kgsl-3d0/gpu_busy_percentage": "12 %",
    "kgsl/kgsl-3d0/temp": "41000",
    "power_supply/battery/current_now": "-412000",
    "power_supply/battery/voltage_now": "4123000",
    "power_supply/battery/temp": "286",
    "power_supply/battery/capacity": "87",
}
THERMAL_LEVELS = range(7)
SURFACE_FLINGER = "GLES: Mesa, llvmpipe, OpenGL ES 3.1\n"


class Persona:
    """Writes the files of one phone below `control` (read on the phone) and `counters` (its /sys/class)."""

    def __init__(self, control: Path, counters: Path) -> None:
        self._control, self._counters = control, counters

    def defaults(self) -> None:
        """A healthy phone: charged, cool, quiet."""
        for name, value in PROPERTIES.items():
            self.set_property(name, value)
        for path, value in COUNTERS.items():
            self.set_counter(path, value)
        self.set_battery()
        self.set_thermal(0)
        self.set_dumpsys("SurfaceFlinger", SURFACE_FLINGER)
        self.set_environment()

    def set_property(self, name: str, value: str) -> None:
        """What `getprop NAME` says, byte for byte; lone surrogates stand for bytes that are not UTF-8."""
        _write(self._control / "properties" / name, value)

    def set_model(self, model: str) -> None:
        """The phone's model name."""
        self.set_property("ro.product.model", model)

    def set_counter(self, path: str, value: str | None) -> None:
        """The text of /sys/class/`path`; None takes the file away."""
        if value is None:
            (self._counters / path).unlink(missing_ok=True)
        else:
            _write(self._counters / path, value + "\n")

    def set_dumpsys(self, service: str, text: str) -> None:
        """What `dumpsys SERVICE` says."""
        _write(self._control / "dumpsys" / service, text)

    def set_battery(self, level: int = 87, celsius: float = 28.6, plugged: bool = True) -> None:
        """Charge in percent and temperature, in `dumpsys battery` and below power_supply."""
        self.set_dumpsys("battery", _battery(level, round(celsius * 10), plugged))
        self.set_counter("power_supply/battery/capacity", str(level))
        self.set_counter("power_supply/battery/temp", str(round(celsius * 10)))

    def set_thermal(self, status: int) -> None:
        """Android's thermal status: 0 none, 3 severe, 6 shutdown."""
        if status not in THERMAL_LEVELS:
            raise ValueError(f"thermal status {status} is not one of Android's, 0 to 6")
        self.set_dumpsys("thermalservice", _thermal(status))

    def set_environment(self, **values: str) -> None:
        """Environment of every later `app_process`, in place of what was set before (RAYFARM_SHIM_LIMITS=...)."""
        if any("\n" in value for value in values.values()):
            raise ValueError("an environment value of a stand-in phone is one line")
        _write(self._control / "environment", "".join(f"{name}={value}\n" for name, value in values.items()))

    def set_flood(self, stdout: int = 0, stderr: int = 0) -> None:
        """Bytes of noise that every later `app_process` writes before it starts."""
        _write(self._control / "flood.stdout", str(stdout))
        _write(self._control / "flood.stderr", str(stderr))

    def set_logcat(self, text: str) -> None:
        """What `logcat` says."""
        _write(self._control / "logcat", text)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(f".{path.name}.new")
    fresh.write_bytes(text.encode("utf-8", "surrogateescape"))
    os.replace(fresh, path)


def _battery(level: int, decicelsius: int, plugged: bool) -> str:
    lines = {
        "AC powered": "false",
        "USB powered": str(plugged).lower(),
        "Wireless powered": "false",
        "status": "2" if plugged else "3",
        "health": "2",
        "present": "true",
        "level": str(level),
        "scale": "100",
        "voltage": "4123",
        "temperature": str(decicelsius),
        "technology": "Li-ion",
    }
    return "Current Battery Service state:\n" + "".join(f"  {key}: {value}\n" for key, value in lines.items())


def _thermal(status: int) -> str:
    temperature = f"Temperature{{mValue={34 + 6 * status}.0, mType=3, mName=skin, mStatus={status}}}"
    return (
        f"IsStatusOverride: false\nThermal Status: {status}\nCached temperatures:\n\t{temperature}\nHAL Ready: true\n"
        f"Current temperatures from HAL:\n\t{temperature}\nCurrent cooling devices from HAL:\n"
    )
