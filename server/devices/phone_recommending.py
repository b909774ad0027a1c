"""A recommendation for a phone, in a process of its own (`python -m server.devices.phone_recommending`).

The task is `{"query", "serial", "via", "deadline_s"}`; `renderer.answering` says how it goes in and the answer comes
out.
"""

from __future__ import annotations

from typing import Any

from renderer.answering import Say, answer_task
from renderer.recommend.query import Query
from renderer.recommend.task import answer
from server.devices.agent_host import DEADLINE_S, AgentHost


def _work(task: dict[str, Any], say: Say) -> dict[str, Any]:
    host = AgentHost(task["serial"], task["via"], task.get("deadline_s", DEADLINE_S))
    return answer(Query.from_json(task["query"]), host, say)


if __name__ == "__main__":
    answer_task(_work)
