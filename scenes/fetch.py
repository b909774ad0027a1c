"""Downloads a catalogue scene from its canonical public address into the user's cache."""

from __future__ import annotations

import logging
import os
import tarfile
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pooch
import requests
import trimesh

from scenes import catalogue, places
from scenes.entry import Download, Entry
from scenes.mesh import Mesh, read_mesh
from scenes.scene import SceneError

TIMEOUT_S = 30


def fetch(name: str, *, tell: Callable[[str], None] = print, progress: bool = True) -> Path:
    """Download the scene `name` unless it is here, check it, and return the file's path.

    `tell` gets one sentence that says what was checked: a checksum of the extracted geometry where one is
    known, else the triangle count. A progress bar goes to stderr. SceneError says what to do by hand.
    """
    entry = catalogue.find(name)
    if entry.made:
        raise SceneError(f"{name} {entry.get}: it is made here.")
    found = places.find_source(entry, verified=True)
    if found is not None:
        tell(f"{name} is here already: {found[0]}")
        return found[0]
    return fetch_entry(entry, places.cache_folder(), tell=tell, progress=progress)


def fetch_entry(entry: Entry, folder: Path, *, tell: Callable[[str], None], progress: bool = False) -> Path:
    """Download `entry` into `folder`, which is created; nothing is left behind when it fails. See `fetch`."""
    download = entry.download
    if download is None:
        raise SceneError(_no_download(entry))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as work:
            archive = _retrieve(download, Path(work), progress)
            member = _extract(archive, download, Path(work))
            mesh, checked = _check(entry, download, member)
            target = folder / download.kept_as
            _keep(mesh, Path(work) / "mesh.ply")
            os.replace(Path(work) / "mesh.ply", target)
    except (SceneError, OSError, ValueError) as error:
        raise SceneError(f"{entry.name} cannot be fetched: {_reason(error)}; {_by_hand(download)}.") from None
    tell(f"{entry.name}: {checked}; saved as {target}")
    return target


def _no_download(entry: Entry) -> str:
    if entry.name.startswith(("happy-buddha", "cornell-buddha")):
        return (
            f"{entry.name} is an {catalogue.OWN_RECONSTRUCTION}: {entry.get},"
            " or fetch happy-buddha-vrip for Stanford's own."
        )
    return f"{entry.name} cannot be fetched by a program: {entry.get}."


def _retrieve(download: Download, work: Path, progress: bool) -> Path:
    pooch.get_logger().setLevel(logging.WARNING)
    downloader = pooch.HTTPDownloader(progressbar=progress, timeout=TIMEOUT_S)
    fname = "archive" + "".join(Path(download.url).suffixes[-2:])
    return Path(pooch.retrieve(download.url, None, fname=fname, path=work, downloader=downloader))


def _extract(archive: Path, download: Download, work: Path) -> Path:
    unpack = pooch.Unzip if zipfile.is_zipfile(archive) else pooch.Untar
    try:
        unpack(members=[download.member], extract_dir="out")(str(archive), "download", None)
    except (KeyError, tarfile.TarError, zipfile.BadZipFile, EOFError):
        raise SceneError(f"the archive is damaged or has no {download.member}") from None
    member = work / "out" / download.member
    if not member.is_file():
        raise SceneError(f"the archive has no {download.member}")
    return member


def _check(entry: Entry, download: Download, member: Path) -> tuple[Mesh, str]:
    if download.sha256 is not None and places.sha256(member) != download.sha256:
        raise SceneError(f"the checksum of {download.member} differs")
    mesh = read_mesh(member, entry.drop)
    expected = entry.triangles - catalogue.BOX_TRIANGLES * entry.boxed
    if len(mesh.faces) != expected:
        raise SceneError(f"{download.member} has {len(mesh.faces):,} triangles instead of {expected:,}")
    if download.sha256 is not None:
        return mesh, f"the sha256 of {download.member} is the expected one"
    return mesh, f"{download.member} has the expected {expected:,} triangles (no checksum is known)"


def _keep(mesh: Mesh, path: Path) -> None:
    """Write binary PLY with 32-bit coordinates, so that what is loaded later is the same to the bit."""
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_normals=mesh.normals, process=False)
    data: bytes = trimesh.exchange.ply.export_ply(solid, vertex_normal=mesh.normals is not None)
    path.write_bytes(data)


def _reason(error: Exception) -> str:
    """A library's error in few words."""
    if isinstance(error, SceneError):
        return str(error).rstrip(".")
    if isinstance(error, requests.HTTPError) and error.response is not None:
        return f"the server answered {error.response.status_code}"
    if isinstance(error, requests.Timeout):
        return "the server did not answer in time"
    if isinstance(error, requests.ConnectionError):
        return "no connection to the server"
    return str(error)[:120] or type(error).__name__


def _by_hand(download: Download) -> str:
    return (
        f"download {download.url} by hand and put its {download.member} as {download.saved_as} into"
        f" {places.cache_folder()} or a folder of {places.VARIABLE}"
    )
