"""The twin as a host that keeps plans ready, so that many can be measured in turn without being made anew."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.host import WARM_UP, Timed
from renderer.plan import Plan, Texture
from renderer.twin import Twin
from renderer.twin_host import TwinHost

MOST_BYTES = 2 << 30
"""The bytes of buffers that are kept; plans that were not measured for longest go first."""


_Key = tuple[str, int]
"""How an array is held, and its identity."""


class KeptTwins(TwinHost):
    """A twin whose timed plans, told apart by identity, stay compiled and uploaded.

    Buffers and filled textures that plans share (one array) are uploaded once. Only a plan's first measurement compiles
    and warms up.
    """

    def __init__(self, threads: int, most_bytes: int = MOST_BYTES) -> None:
        """Keep at most `most_bytes` of buffers beside the plan that is measured."""
        super().__init__(threads)
        self._programs: dict[str, Any] = {}
        self._held: dict[_Key, _Shared] = {}
        self._twins: OrderedDict[int, _Sharing] = OrderedDict()
        self._most_bytes = most_bytes

    def measure(self, plan: Plan, frames: int, between: Callable[[], None]) -> Timed:
        """Time frames; `compile_s` is 0 for a plan that was ready."""
        begun = time.perf_counter()
        twin = self._twins.get(id(plan))
        fresh = twin is None
        if twin is None:
            twin = self._twins[id(plan)] = _Sharing(self._context(), plan, self._programs, self._held)
            self._make_room()
        self._twins.move_to_end(id(plan))
        twin.arm()
        if fresh:
            twin.setup()
            for _ in range(WARM_UP):
                twin.frame()
        made_s = time.perf_counter() - begun if fresh else 0.0
        return Timed(twin.time_frames(frames, between), made_s, twin.image())

    def forget(self, plan: Plan) -> None:
        """Give a plan's memory back."""
        twin = self._twins.pop(id(plan), None)
        if twin is not None:
            twin.release()

    def _make_room(self) -> None:
        while len(self._twins) > 1 and sum(one.nbytes for one in self._held.values()) > self._most_bytes:
            self._twins.popitem(last=False)[1].release()


class _Shared:
    """A device's buffer or texture, the array that it holds, and how many plans use it."""

    def __init__(self, made: Any, data: npt.NDArray[np.uint32]) -> None:
        self.made, self.data, self.users = made, data, 0

    @property
    def nbytes(self) -> int:
        return int(self.data.nbytes)


class _Sharing(Twin):
    """A twin that shares programs of one text, and buffers and textures of one array with others."""

    def __init__(self, context: Any, plan: Plan, programs: dict[str, Any], shared: dict[_Key, _Shared]) -> None:
        self._shared = shared
        self._used: list[_Key] = []
        super().__init__(context, plan, programs)

    def release(self) -> None:
        """Give back what nobody else uses."""
        own = {id(self._shared[key].made) for key in self._used}
        for held in (self._buffers, self._textures):
            for name in [name for name, made in held.items() if id(made) in own]:
                del held[name]
        super().release()
        for key in self._used:
            one = self._shared[key]
            one.users -= 1
            if one.users == 0:
                del self._shared[key]
                one.made.release()

    def _upload(self, nbytes: int, data: npt.NDArray[np.uint32] | None) -> Any:
        if data is None:
            return super()._upload(nbytes, data)
        return self._once("buffer", data, partial(super()._upload, nbytes, data))

    def _filled(self, texture: Texture, data: npt.NDArray[np.uint32]) -> Any:
        return self._once("texture", data, partial(super()._filled, texture, data))

    def _once(self, kind: str, data: npt.NDArray[np.uint32], make: Callable[[], Any]) -> Any:
        """What holds an array as a buffer or as a texture; made by the first that needs it."""
        key = (kind, id(data))
        if key not in self._shared:
            self._shared[key] = _Shared(make(), data)
        self._shared[key].users += 1
        self._used.append(key)
        return self._shared[key].made
