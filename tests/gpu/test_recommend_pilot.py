"""The pilot on the twin: what is measured small is judged and confirmed at the full size."""

from __future__ import annotations

from renderer.answering import silent
from renderer.kept_twins import KeptTwins
from renderer.recommend.halving import Terms, pilot_sizes, recommend
from renderer.recommend.pilot import Pilot
from renderer.request import Request
from renderer.variant import Variant

SIZE = (300, 200)


def test_finalists_are_judged_at_a_size_at_which_nothing_was_measured() -> None:
    walks = ("bvh-stack", "bvh-packet-2x2", "kd-backtrack", "brute-force")
    requests = [
        Request("cornell-box", Variant(walk, "compute", "normal"), SIZE, frames=1, rounds=1, rays="primary")
        for walk in walks
    ]
    assert SIZE not in pilot_sizes(SIZE)
    pilot = Pilot(requests, KeptTwins(1))
    found = recommend(pilot.candidates(silent), pilot.measure, pilot.judge, Terms(SIZE, rounds=2), silent)
    assert found.pick is not None
    assert pilot.failed == found.failed == {}
    assert pilot.facts[found.pick.label].size == SIZE
    judged = {label for label, facts in pilot.facts.items() if facts.size == SIZE}
    assert judged >= {one.label for one in found.finalists}
