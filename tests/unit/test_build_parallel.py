"""Work on all cores is the work of one: its order, its error state, and blocks that hold every row once."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.build.parallel import blocks, each


@pytest.mark.parametrize("threads", ["1", "2"])
def test_tasks_keep_their_caller_s_error_state(threads: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hard cases are packed where a signalling NaN is no warning, whoever packs them."""
    monkeypatch.setenv("RAYFARM_BUILD_THREADS", threads)

    def signal() -> bool:
        signalling = np.array([0x7FA00000], np.uint32).view(np.float32)
        return bool(np.isnan(signalling + np.float32(0.0)).all())

    with np.errstate(invalid="ignore"):
        assert each([signal] * 4) == [True] * 4
    with np.errstate(invalid="raise"), pytest.raises(FloatingPointError):
        each([signal])


@pytest.mark.parametrize("count", [0, 1, 1 << 14, (1 << 14) + 1, 50_000])
def test_blocks_hold_every_row_once(count: int) -> None:
    rows = np.arange(count)
    np.testing.assert_array_equal(np.concatenate([rows[:0], *(rows[block] for block in blocks(count))]), rows)
