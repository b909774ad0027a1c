"""How a package's functions are compiled: numba without fast-math, kept on disk between processes.

numba tells whether its cache is stale by the file of the compiled function alone, though it inlines functions of
other files. So the cache lies in a folder named by the digest of all sources of the function's own package, and
compiled functions call compiled functions of their own package only.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def jit(function: Function) -> Function:
    """`function` compiled on its first call; it keeps the type that it is written with."""
    return _compiled(function, "never")


def inline(function: Function) -> Function:
    """`function` compiled into each of its callers."""
    return _compiled(function, "always")


def _compiled(function: Function, inlined: Literal["always", "never"]) -> Function:
    config: Any = numba.config
    package = Path(function.__code__.co_filename).parent
    previous, config.CACHE_DIR = config.CACHE_DIR, _cache_folder(config.CACHE_DIR, package)
    try:
        compiler: Any = numba.njit(cache=True, error_model="numpy", nogil=True, inline=inlined)
        return cast(Function, compiler(function))
    finally:
        config.CACHE_DIR = previous


@lru_cache
def _cache_folder(chosen: str, package: Path) -> str:
    """A folder for these very sources, below the user's choice (NUMBA_CACHE_DIR) or beside them."""
    digest = hashlib.sha256()
    for source in sorted(package.glob("*.py")):
        digest.update(source.read_bytes())
    return str(Path(chosen or package / "__pycache__") / f"numba-{digest.hexdigest()[:16]}")
