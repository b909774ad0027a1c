"""The one way in which builders are compiled: numba without fast-math, kept on disk between processes.

numba tells whether its cache is stale by the file of the compiled function alone, though it inlines functions of
other files. So the cache lies in a folder named by the digest of all of this package's sources.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def jit(function: Function) -> Function:
    """`function` compiled on its first call; it keeps the type that it is written with."""
    config: Any = numba.config
    previous, config.CACHE_DIR = config.CACHE_DIR, _cache_folder(config.CACHE_DIR)
    try:
        return cast(Function, numba.njit(cache=True, error_model="numpy", nogil=True)(function))
    finally:
        config.CACHE_DIR = previous


@lru_cache
def _cache_folder(chosen: str) -> str:
    """A folder for these very sources, below the user's choice (NUMBA_CACHE_DIR) or beside them."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for source in sorted(here.glob("*.py")):
        digest.update(source.read_bytes())
    return str(Path(chosen or here / "__pycache__") / f"numba-{digest.hexdigest()[:16]}")
