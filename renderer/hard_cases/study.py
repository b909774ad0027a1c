"""All variants against all families, in processes that may crash or hang without ending the study."""

from __future__ import annotations

import json
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from renderer.child import ChildError, run_child
from renderer.hard_cases.cell import Cell
from renderer.pairs import meeting
from renderer.variant import AXES, TRAVERSALS, Variant, matrix
from scenes.hard_cases import FAMILIES

Json = dict[str, Any]
SEED = 5
CHILD = "renderer.hard_cases.child"


@dataclass(frozen=True)
class Order:
    """What to run: `share` of each family's rays; `fitted` families a variant whose specialised text is checked too.

    A cell that takes longer than `limit_s` hangs. `timed` measures the costs.
    """

    variants: Sequence[Variant]
    families: Sequence[str] = tuple(FAMILIES)
    seed: int = SEED
    share: float = 1.0
    fitted: int = 1
    limit_s: float = 120.0
    timed: bool = True
    processes: int = 2


TESTED = ("traversal", "intersector", "box", "nodes", "precision", "offset", "fetch")
"""The axes whose values may change an answer."""


def all_variants(traversals: Sequence[str] = tuple(TRAVERSALS)) -> list[Variant]:
    """Every valid combination of values on TESTED."""
    return matrix({"method": ("compute",), **{axis: AXES[axis] for axis in TESTED}, "traversal": traversals})[0]


def few_variants(traversals: Sequence[str] = tuple(TRAVERSALS)) -> list[Variant]:
    """Every traversal with every intersector, and variants in which every two values meet.

    These leave the defaults on two axes at most, besides the traversal: what one value loses must not hide in what
    another does.
    """
    every = all_variants(traversals)
    plain = [variant for variant in every if _departures(variant) <= {"intersector"}]
    return [*plain, *meeting([variant for variant in every if len(_departures(variant)) <= 2], TESTED, plain)]


def _departures(variant: Variant) -> set[str]:
    """The axes but for the traversal on which a variant leaves the defaults."""
    return {axis for axis in TESTED[1:] if getattr(variant, axis) != getattr(Variant(), axis)}


@dataclass(frozen=True)
class Ran:
    """The cells of an order as plain rows, those that crashed or hung among them, and the device that filled them.

    `device` is None where no process lived to tell.
    """

    rows: list[Json]
    device: Json | None


def run_order(order: Order, say: Callable[[int, int], None] = lambda done, crashed: None) -> Ran:
    """Fill the cells of an order; `say` is told how many are filled and lost."""
    with tempfile.TemporaryDirectory(prefix="rayfarm-hard-cases-") as folder:
        shards = [_Shard(order, index, Path(folder)) for index in range(order.processes)]
        threads = [threading.Thread(target=shard.run) for shard in shards]
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            time.sleep(1.0)
            say(sum(len(shard.rows()) for shard in shards), sum(len(shard.lost) for shard in shards))
        rows = [row for shard in shards for row in (*shard.rows(), *shard.lost)]
        return Ran(rows, next((device for shard in shards if (device := shard.device())), None))


class _Shard:
    """Every n-th variant, in one process after the other: a new one for each crash."""

    def __init__(self, order: Order, index: int, folder: Path) -> None:
        self.lost: list[Json] = []
        self._order, self._folder = order, folder
        self._journal = folder / f"journal-{index}"
        self._variants = order.variants[index :: order.processes]
        # Shards begin at different families, so that each finds half of the referee's answers made by the other.
        turn = index * len(order.families) // order.processes
        self._families = [*order.families[turn:], *order.families[:turn]]

    def run(self) -> None:
        """Run until every cell is filled or lost."""
        while self._variants:
            try:
                run_child(CHILD, self._task(), 1, 24 * 3600.0)
                return
            except ChildError as error:
                self._lose(str(error))

    def rows(self) -> list[Json]:
        """The cells filled so far."""
        return [line["cell"] for line in self._lines() if "cell" in line]

    def device(self) -> Json | None:
        """What the cells are filled on, as far as a process told."""
        return next((line["device"] for line in self._lines() if "device" in line), None)

    def _task(self) -> Json:
        order = self._order
        done = [[row["variant"], row["family"]] for row in (*self.rows(), *self.lost)]
        return {
            "variants": [variant.as_dict() for variant in self._variants],
            "families": self._families,
            "seed": order.seed,
            "share": order.share,
            "fitted": order.fitted,
            "limit_s": order.limit_s,
            "timed": order.timed,
            "journal": str(self._journal),
            "folder": str(self._folder),
            "done": done,
        }

    def _lose(self, reason: str) -> None:
        """Note the cell at which the process ended; an end between cells ends the shard."""
        lines = self._lines()
        if not lines or "begin" not in lines[-1]:
            raise ChildError(reason)
        values, family = lines[-1]["begin"]
        hung = time.time() - lines[-1]["at"] >= self._order.limit_s
        sentence = f"No answer after {self._order.limit_s:g} s." if hung else reason
        variant = Variant(**values)
        self.lost.append(Cell(variant, family, self._order.seed, "hung" if hung else "crashed", sentence).to_json())

    def _lines(self) -> list[Json]:
        if not self._journal.exists():
            return []
        whole = self._journal.read_text(encoding="utf-8").rpartition("\n")[0]
        return [json.loads(line) for line in whole.splitlines()]
