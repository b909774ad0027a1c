"""The service's settings, read from the environment with the prefix `RAYFARM_`."""

from __future__ import annotations

import socket
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal

from platformdirs import user_data_path
from pydantic import AfterValidator, Field, SecretStr, ValidationError
from pydantic_core import PydanticCustomError
from pydantic_settings import BaseSettings, SettingsConfigDict

from server.logs import Form, Level


class SettingsError(ValueError):
    """A setting that cannot be used; the message is one sentence that names it."""


def data_folder() -> Path:
    """The folder for what the service keeps, per user."""
    return user_data_path("rayfarm", appauthor=False)


def _default_database() -> str:
    return f"sqlite:///{data_folder() / 'rayfarm.sqlite'}"


def _default_blobs() -> str:
    return str(data_folder() / "blobs")


def _check_blobs(where: str) -> str:
    """A folder, or a bucket's URL."""
    scheme, mark, place = where.partition("://")
    if not where or (mark and (scheme != "s3" or not place.strip("/"))):
        raise PydanticCustomError("blobs", "give a folder, or s3://bucket/prefix")
    return where


class Settings(BaseSettings):
    """Where the service listens and where it keeps things.

    `database_url` is an SQLAlchemy URL. `blobs` is the folder, or the bucket `s3://bucket/prefix`, of what is too large
    for it: pictures, and imported profiles, none of which may be larger than `profile_mb` megabytes; servers and
    workers share it. Raw frames and files are pruned after `keep_frames_days` and `keep_files_days`, or kept for ever.
    `require_tokens` asks for tokens at a loopback address too, of which each may send `submissions_per_minute` (0
    for any number). `allowed_hosts` are the names under which the service may be addressed. `slice_timeout_s` bounds
    one slice, `slice_memory_mb` its process's memory in megabytes, `lease_s` is how long a worker that shows no sign of
    life keeps its slices, `poll_s` how often a worker looks for work; in seconds. `worker_host` names the machine that
    phones are attached to, where its host name will not do. `phones` and `llvmpipe` say what a worker cares for, `via`
    how a phone's agent is run: by `app_process` or as an app. `log` is the form of the lines on standard error, `auto`
    plain on a terminal and JSON elsewhere, and `log_level` the least that is logged.
    """

    model_config = SettingsConfigDict(env_prefix="RAYFARM_")

    database_url: str = Field(default_factory=_default_database)
    blobs: Annotated[str, AfterValidator(_check_blobs)] = Field(default_factory=_default_blobs)
    profile_mb: int = Field(default=1000, ge=1)
    keep_frames_days: int | None = Field(default=None, ge=1)
    keep_files_days: int | None = Field(default=None, ge=1)
    host: str = "127.0.0.1"
    port: int = Field(default=8710, ge=0, le=65535)
    require_tokens: bool = False
    submissions_per_minute: int = Field(default=600, ge=0)
    token: SecretStr | None = Field(default=None, description="what the CLI's verbs send to the service")
    token_file: Path | None = None
    allowed_hosts: tuple[str, ...] = ("localhost", "127.0.0.1", "[::1]")
    slice_timeout_s: float = Field(default=900.0, gt=0)
    slice_memory_mb: int | None = Field(default=None, ge=100)
    lease_s: float = Field(default=60.0, ge=1)
    poll_s: float = Field(default=0.5, ge=0.05, le=60)
    phones: bool = True
    llvmpipe: bool = True
    via: Literal["shell", "apk"] = "shell"
    log: Form = "auto"
    log_level: Level = "info"
    worker_host: str = Field(default_factory=socket.gethostname, min_length=1, max_length=100)
    server: str = Field(default="http://127.0.0.1:8710", description="where the CLI's verbs find the service")


@lru_cache(maxsize=1)
def settings() -> Settings:
    """The settings of this process; raise SettingsError naming the first variable that is wrong."""
    try:
        return Settings()
    except ValidationError as error:
        first = error.errors()[0]
        name = "RAYFARM_" + "_".join(str(part) for part in first["loc"]).upper()
        raise SettingsError(f"The environment variable {name} is wrong: {first['msg'].lower()}.") from error
