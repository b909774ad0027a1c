"""Makes what runs the agent's DEX on this machine: `desktop/`, the stand-ins for Android, and `agent-desktop.jar`."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

from agent_android.build_tools import (
    HERE,
    compile_java,
    fetched,
    require,
    run,
    sha256,
    sha256_of_all,
    write,
    zip_files,
)

# Not `--release`: the process's CPU time and id come from classes that it hides.
_LEVEL = ("-source", "8", "-target", "8", "-Xlint:-options")


def make_desktop(out: Path) -> None:
    """Bring the stand-ins in `out` up to date; raise BuildError when a tool is missing or fails."""
    shim = sorted((HERE / "desktop").rglob("*.java"))
    wanted = sha256_of_all([*shim, HERE / "pom.xml"], HERE)
    stamp = out / "desktop" / "stamp"
    if stamp.exists() and stamp.read_text() == wanted:
        return
    with tempfile.TemporaryDirectory(dir=out) as folder:
        made = _gather(shim, Path(folder))
        (made / "stamp").write_text(wanted)
        shutil.rmtree(out / "desktop", ignore_errors=True)
        made.rename(out / "desktop")


def turn_back(out: Path) -> None:
    """Turn agent.jar's DEX back into classes, so that what runs here is what is shipped."""
    program = require("enjarify", "enjarify (enjarify)")
    jar, turned, stamp = out / "agent.jar", out / "agent-desktop.jar", out / "agent-desktop.sha256"
    wanted = sha256(jar)
    if turned.exists() and stamp.exists() and stamp.read_text() == wanted:
        return
    with tempfile.TemporaryDirectory() as folder:
        # enjarify takes a DEX's container by its name.
        dex, classes = Path(folder) / "agent.apk", Path(folder) / "agent.jar"
        shutil.copy(jar, dex)
        # Its script would take whatever Python comes first; its module belongs to the one installed beside it.
        run(program, "-f", "-o", str(classes), str(dex), more={"PYTHON": str(Path(program).parent / "python3")})
        write(turned, classes.read_bytes())
    write(stamp, wanted.encode())


def _gather(shim: Sequence[Path], work: Path) -> Path:
    jars = fetched("-Pdesktop")
    made = work / "desktop"
    (made / "natives").mkdir(parents=True)
    lwjgl = [jar for name, jar in jars.items() if name.startswith("lwjgl")]
    for jar in lwjgl:
        if "natives" in jar.name:
            _unpack_libraries(jar, made / "natives")
        else:
            shutil.copy(jar, made / jar.name)
    # Android's own org.json, so that the agent runs on the implementation that phones have.
    with zipfile.ZipFile(jars["android-all"]) as android:
        names = sorted(name for name in android.namelist() if name.startswith("org/json/") and name.endswith(".class"))
        android.extractall(work / "json", names)
    zip_files(made / "json.jar", work / "json", names)
    classes = compile_java(shim, [*lwjgl, made / "json.jar"], _LEVEL, work / "shim")
    zip_files(made / "desktop.jar", classes, sorted(str(p.relative_to(classes)) for p in classes.rglob("*.class")))
    return made


def _unpack_libraries(jar: Path, into: Path) -> None:
    with zipfile.ZipFile(jar) as packed:
        for name in packed.namelist():
            if name.endswith(".so"):
                (into / Path(name).name).write_bytes(packed.read(name))
