"""`rayfarm doctor` on machines that lack one thing each, taken away for real: it names it and says how to mend it."""

from __future__ import annotations

import io
import json
import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from alembic import command
from alembic.config import Config
from postgres import PostgresCluster
from service_fakes import running_service
from sqlalchemy import text

from agent_android.standin.adb_server import AdbServer
from server.access import tokens
from server.cli import doctor as verb
from server.cli.app import run
from server.doctor import packages, phones
from server.doctor.graphics import NEEDED, judged
from server.settings import settings
from server.store.database import MIGRATIONS, Database
from server.store.engines import make_engine, writing_engine

ROOT = Path(__file__).parents[2]
NOBODY = 65534

Sentences = dict[str, str]
Doctor = Callable[..., tuple[int, Sentences]]
"""Makes checks: the exit code, and each sentence that is not `good` with its state."""


@pytest.fixture(autouse=True)
def _machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A machine of its own as far as folders, database and adb's port go, on which nothing is missing."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        monkeypatch.setenv("ANDROID_ADB_SERVER_PORT", str(free.getsockname()[1]))
    for name, value in (("BLOBS", "blobs"), ("CACHE", "cache"), ("LOCKS", "locks")):
        monkeypatch.setenv(f"RAYFARM_{name}", str(tmp_path / value))
    monkeypatch.setenv("RAYFARM_DATABASE_URL", f"sqlite:///{tmp_path / 'farm.sqlite'}")
    monkeypatch.setenv("RAYFARM_PHONES", "on")
    monkeypatch.delenv("RAYFARM_SCENES", raising=False)
    yield
    settings.cache_clear()


@pytest.fixture
def doctor() -> Doctor:
    def make(*checks: str) -> tuple[int, Sentences]:
        settings.cache_clear()
        with redirect_stdout(io.StringIO()) as out:
            code = run(["doctor", *checks, "--json"])
        found = json.loads(out.getvalue())["findings"]
        return code, {each["sentence"]: each["state"] for each in found if each["state"] != "good"}

    return make


def only(found: tuple[int, Sentences], state: str = "missing") -> str:
    """The one sentence that was said, which decides the exit code."""
    code, said = found
    assert list(said.values()) == [state], said
    assert code == (1 if state == "missing" else 0)
    return next(iter(said))


def test_nothing_need_be_mended_here(doctor: Doctor) -> None:
    code, said = doctor()
    assert (code, set(said.values()) - {"note"}) == (0, set()), said


def test_it_says_so_in_a_terminal_too(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    assert run(["doctor", "python", "programs"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[:2] == ["ok", "python"]
    assert lines[1].startswith("MEND programs   glslangValidator is not on the PATH: install glslang-tools")
    assert lines[-1] == "1 to mend, 0 to note, 1 good."


def test_an_unknown_check_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor", "nose"]) == 2
    assert "choose from python, packages" in capsys.readouterr().err


def test_every_check_has_a_function() -> None:
    for module, function in (verb.CHECKS | verb.ASKED).values():
        assert callable(getattr(__import__(f"server.doctor.{module}", fromlist=[function]), function))


def test_a_wrong_setting_is_named(doctor: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_PORT", "many")
    assert "The environment variable RAYFARM_PORT is wrong" in only(doctor("tokens"))


# Python and packages


def test_an_old_python() -> None:
    assert list(packages.python((3, 10, 2))) == [
        ("missing", "Python 3.10.2 is too old: run `make PYTHON=python3.11`, or a later one.")
    ]


def test_another_version_of_a_package(doctor: Doctor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    facts = tmp_path / "numpy-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: numpy\nVersion: 1.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    said = only(doctor("packages"))
    assert "numpy 1.0 (not " in said
    assert said.endswith("run `rm -f .venv/.ready && make`.")


def test_a_package_that_is_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    facts = tmp_path / "rayfarm-9.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: rayfarm\nVersion: 9\nRequires-Dist: left-pad>=1\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert ("missing", f"left-pad is not installed: {packages.AGAIN}.") in list(packages.packages())


def test_no_constraints_to_compare_with(tmp_path: Path) -> None:
    ((state, sentence),) = packages.packages(tmp_path / "constraints.txt")
    assert state == "note"
    assert "not compared" in sentence


# Graphics


@pytest.mark.parametrize(
    ("name", "value"), [("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json"), ("MESA_GL_VERSION_OVERRIDE", "3.3")]
)
def test_no_context_can_be_made(doctor: Doctor, monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    monkeypatch.setenv(name, value)
    said = only(doctor("graphics"))
    assert said.startswith("No OpenGL 4.3 context could be made through EGL")
    assert "apt-get install libegl1" in said


def test_a_driver_that_crashes(doctor: Doctor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "moderngl.py").write_text("import os\nos.abort()\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert only(doctor("graphics")).startswith("The OpenGL driver crashes or hangs: install Mesa anew")


def test_limits_and_versions_that_are_too_low() -> None:
    info: dict[str, Any] = {f"GL_MAX_{name}": least for name, least in NEEDED.items()}
    info |= {"GL_RENDERER": "llvmpipe (LLVM 9)", "GL_VERSION": "4.5 (Core Profile) Mesa 20.3.5"}
    assert [state for state, _ in judged(info)] == ["note", "good"]
    info |= {"GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS": 0, "GL_RENDERER": "Quadro", "GL_VERSION": "4.6 NVIDIA"}
    (note, other), (missing, low) = judged(info)
    assert (note, missing) == ("note", "missing")
    assert "LIBGL_ALWAYS_SOFTWARE=1" in other
    assert "GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS = 0" in low


# Folders


@pytest.mark.parametrize("variable", ["RAYFARM_BLOBS", "RAYFARM_CACHE", "RAYFARM_LOCKS", "NUMBA_CACHE_DIR"])
def test_a_folder_that_cannot_be_written(
    doctor: Doctor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv(variable, str(tmp_path / "file" / "folder"))
    said = only(doctor("folders"))
    assert "cannot be written (not a directory)" in said
    assert said.endswith(f"correct {variable}.")


def test_a_disk_that_is_nearly_full(tmp_path: Path) -> None:
    private = ["unshare", "--mount"]
    if (
        shutil.which("unshare") is None
        or subprocess.run([*private, "true"], capture_output=True, check=False).returncode
    ):
        pytest.skip("this machine lets this user mount no small disk")
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = f'mount -t tmpfs -o size=8m none "{disk}" && exec "$@"'
    words = [sys.executable, "-m", "server.cli.app", "doctor", "folders"]
    environment = {**os.environ, "RAYFARM_CACHE": str(disk)}
    command = [*private, "sh", "-c", mount, "sh", *words]
    said = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    assert said.returncode == 1, said.stderr
    assert "has 0.0 GiB left: make room, or set RAYFARM_CACHE." in said.stdout


def test_a_folder_of_scenes_that_is_not_there(doctor: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_SCENES", "/nowhere/scenes")
    assert only(doctor("scenes")).startswith("RAYFARM_SCENES names /nowhere/scenes, where no folder is")


# Database and tokens


def test_looking_makes_nothing(doctor: Doctor, tmp_path: Path) -> None:
    assert doctor("database", "tokens", "folders") == (0, {})
    assert list(tmp_path.iterdir()) == []


def test_a_database_that_does_not_answer(doctor: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    monkeypatch.setenv("RAYFARM_DATABASE_URL", f"postgresql://me:secret@127.0.0.1:{port}/farm")
    said = only(doctor("database"))
    assert said.startswith("No server answers at postgresql://me")
    assert "start PostgreSQL or correct the URL" in said
    assert "secret" not in said


def test_a_database_that_refuses_the_password(
    doctor: Doctor, postgres_cluster: PostgresCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RAYFARM_DATABASE_URL", postgres_cluster.url().replace(postgres_cluster.password, "wrong"))
    assert "correct user and password" in only(doctor("database"))


def test_a_url_that_is_none(doctor: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_DATABASE_URL", "mysql://here/farm")
    assert "SQLite or PostgreSQL, not in mysql" in only(doctor("database"))


def test_tables_of_an_earlier_and_of_a_later_release(
    doctor: Doctor, database_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RAYFARM_DATABASE_URL", database_url)
    Database(database_url).close()
    assert doctor("database") == (0, {})
    set_revision(database_url, "later")
    assert "was written by a later RayFarm" in only(doctor("database"))


def test_tables_one_version_behind(doctor: Doctor, tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'farm.sqlite'}"
    engine = make_engine(url)
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    with writing_engine(engine).begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0007")
    engine.dispose()
    said = only(doctor("database"), "note")
    assert "has the tables of 0007, this program those of " in said
    assert "keep a copy" in said
    assert "the tables of 0007" in only(doctor("database"), "note")  # It was not brought up to date by being asked.


def test_an_open_address_without_a_token(doctor: Doctor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_HOST", "0.0.0.0")
    said = only(doctor("tokens"))
    assert "RAYFARM_HOST is 0.0.0.0" in said
    assert "`rayfarm tokens create NAME --scope admin`" in said
    database = Database(f"sqlite:///{tmp_path / 'farm.sqlite'}")
    with database.writing() as session:
        tokens.create(session, "lab", ["admin"], timedelta(days=300))
    assert doctor("tokens") == (0, {})
    with database.writing() as session:
        tokens.create(session, "ci", ["submit"], timedelta(days=3))
    database.close()
    assert only(doctor("tokens"), "note").startswith("The token of ci expires on ")


def set_revision(url: str, revision: str) -> None:
    database = Database(url)
    with database.writing() as session:
        session.execute(text("UPDATE alembic_version SET version_num = :to"), {"to": revision})
    database.close()


# adb and phones


def test_no_adb_that_runs(doctor: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ADBUTILS_ADB_PATH", "/nowhere/adb")
    said = only(doctor("adb"))
    assert said == "There is no adb that runs: apt-get install adb, and correct ADBUTILS_ADB_PATH if it is set."


def test_a_path_without_adb_is_well(doctor: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    assert doctor("adb") == (0, {})


def test_no_port_of_an_adb_server(doctor: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ANDROID_ADB_SERVER_PORT", "usb")
    assert only(doctor("adb")).endswith("give the port of an adb server.")


def test_something_else_listens_at_adb_s_port(doctor: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    with greeting(b"SSH-2.0-OpenSSH_9.2\r\n") as port:
        monkeypatch.setenv("ANDROID_ADB_SERVER_PORT", str(port))
        said = only(doctor("adb"))
    assert said == f"What listens at 127.0.0.1:{port} is no adb server: end it, or set ANDROID_ADB_SERVER_PORT."


def test_an_adb_server_that_runs(doctor: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    with AdbServer() as server:
        monkeypatch.setenv("ANDROID_ADB_SERVER_PORT", str(server.port))
        assert doctor("adb") == (0, {})


def test_another_user_s_log_stops_adb(doctor: Doctor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / f"adb.{os.getuid()}.log"
    log.mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    assert only(doctor("adb")) == f"{log} is not this user's, so that no adb server starts: remove it."


def test_a_phone_on_usb_that_may_not_be_opened(tmp_path: Path) -> None:
    node = plugged(tmp_path)
    assert list(phones.usb(tmp_path)) == [("good", "The phone Pixel 8 3A01 on USB may be opened.")]
    with as_nobody(node):
        ((state, sentence),) = phones.usb(tmp_path)
    assert state == "missing"
    assert sentence.startswith(f"This user may not open the phone Pixel 8 3A01 on USB ({node}): copy deploy/51-")
    assert (ROOT / "deploy" / phones.RULES).exists()


def test_no_rule_for_phones(tmp_path: Path) -> None:
    settings.cache_clear()
    assert [state for state, _ in phones.usb(tmp_path)] == ["note"]
    rules = tmp_path / phones.RULE_FOLDERS[0]
    rules.mkdir(parents=True)
    (rules / phones.RULES).touch()
    assert [state for state, _ in phones.usb(tmp_path)] == ["good"]


def plugged(root: Path) -> Path:
    """A phone as Linux shows one below `root`; its device node."""
    devices = root / "sys/bus/usb/devices"
    facts = {"busnum": "3", "devnum": "7", "product": "Pixel 8", "serial": "3A01"}
    for folder, values in (
        ("3-1", facts),
        ("3-1:1.0", {"bInterfaceClass": "06", "bInterfaceSubClass": "01", "bInterfaceProtocol": "01"}),
        ("3-1:1.1", {"bInterfaceClass": "ff", "bInterfaceSubClass": "42", "bInterfaceProtocol": "01"}),
    ):
        (devices / folder).mkdir(parents=True)
        for name, value in values.items():
            (devices / folder / name).write_text(f"{value}\n")
    node = root / "dev/bus/usb/003/007"
    node.parent.mkdir(parents=True)
    node.touch()
    return node


@contextmanager
def as_nobody(node: Path) -> Iterator[None]:
    """A user to whom the node is closed: root may open whatever is there."""
    node.chmod(0o600 if os.geteuid() == 0 else 0)
    opened = [folder for folder in node.parents if os.geteuid() == 0 and not folder.stat().st_mode & 0o001]
    modes = {folder: folder.stat().st_mode for folder in opened}
    for folder, mode in modes.items():
        folder.chmod(mode | 0o055)
    if os.geteuid() == 0:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        if os.getuid() == 0:
            os.seteuid(0)
        for folder, mode in modes.items():
            folder.chmod(mode)


@contextmanager
def greeting(words: bytes) -> Iterator[int]:
    """A server that greets whoever connects; its port."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def greet() -> None:
            while True:
                try:
                    connection, _ = listening.accept()
                except OSError:
                    return
                with connection, suppress(ConnectionError):
                    connection.sendall(words)
                    connection.recv(100)

        thread = threading.Thread(target=greet)
        thread.start()
        yield listening.getsockname()[1]
        listening.shutdown(socket.SHUT_RDWR)
        thread.join()


# The agent and the compilers


@pytest.mark.parametrize(
    ("break_it", "says"),
    [
        ("rm -rf agent_android/build", "note:The phone's agent is not built: run `make agent`."),
        ("echo x >>agent_android/build/agent.jar", "is not the one that agent.json describes"),
        ("echo '// x' >>agent_android/src/org/rayfarm/agent/Main.java", "its sources 0.1.0+"),
    ],
)
def test_an_agent_that_is_not_of_these_sources(tmp_path: Path, break_it: str, says: str) -> None:
    if not (ROOT / "agent_android/build/agent.json").exists():
        pytest.skip("the agent is not built: make agent")
    for name in ("agent_android", "renderer", "scenes", "server", "shaders", "pyproject.toml"):
        subprocess.run(["cp", "-r", str(ROOT / name), str(tmp_path)], check=True)
    subprocess.run(["sh", "-ec", break_it], cwd=tmp_path, check=True)
    words = [sys.executable, "-m", "server.cli.app", "doctor", "agent", "--json"]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    ran = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    (found,) = json.loads(ran.stdout)["findings"]
    assert says.removeprefix("note:") in found["sentence"]


def test_compilers_that_are_not_where_they_should_be(doctor: Doctor, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "`make phone-compiler` builds them" in only(doctor("compilers"), "note")
    monkeypatch.setenv("RAYFARM_PHONE_COMPILER", "/nowhere")
    assert "/nowhere, which RAYFARM_PHONE_COMPILER names" in only(doctor("compilers"))


# What runs


def test_a_service_and_its_worker(doctor: Doctor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with running_service(tmp_path) as service, service.working():
        monkeypatch.setenv("RAYFARM_DATABASE_URL", service.database_url)
        monkeypatch.setenv("RAYFARM_SERVER", str(service.client.base_url))
        monkeypatch.setenv("RAYFARM_WORKER_HOST", "here")
        assert doctor("service", "worker") == (0, {})
        monkeypatch.setenv("RAYFARM_WORKER_HOST", "there")
        assert only(doctor("worker")).startswith("No worker of there gave a sign of life for 60 s: start `rayfarm")
    assert only(doctor("service")).startswith("No RayFarm service answers at ")
