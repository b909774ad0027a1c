"""The state of the page of pictures: its query string, and the jobs that it chooses where that names none."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import urlencode

from sqlalchemy.orm import Session

from renderer.pictures.files import PictureError
from renderer.variant import AXES
from server.api.views import MAX_ID
from server.pictures.jobs import LOOKED_AT, WHATS, Pictured, find_pictured, list_pictured

VIEWS = {"slider": "slider", "side": "side by side", "difference": "difference", "all": "all, on one scale"}
"""How two jobs are shown, or with `all` every variant of a scene."""
MOST = 24
"""The most pictures on one page."""
MIDDLE = 50
"""Where the slider cuts at first, in per cent from the left."""
NAMES = ("scene", "study", "baseline", "against", "what", "view", "cut")


@dataclass(frozen=True)
class Asked:
    """What an address asks for; what is None is chosen."""

    scene: str | None
    study: int | None
    baseline: str | None
    against: str | None
    what: str
    view: str
    cut: int


@dataclass(frozen=True)
class Choice:
    """What a page shows: the jobs that can be chosen, newest first, and the chosen ones; `scenes` have pictures."""

    asked: Asked
    scene: str | None
    scenes: list[str]
    jobs: list[Pictured]
    baseline: Pictured | None
    against: Pictured | None
    note: str

    def query(self, **changes: str) -> str:
        """The query string of exactly this page with some parameters replaced."""
        asked = self.asked
        values = {
            "scene": self.scene or "",
            "study": "" if asked.study is None else str(asked.study),
            "baseline": "" if self.baseline is None else str(self.baseline.job),
            "against": "" if self.against is None else str(self.against.job),
            "what": asked.what,
            "view": asked.view,
            "cut": "" if asked.cut == MIDDLE else str(asked.cut),
        }
        return urlencode([(name, value) for name, value in (values | changes).items() if value])

    @property
    def all_of_scene(self) -> list[Pictured]:
        """The latest job of every variant, device and size that has what is shown, in the traversals' order."""
        wanted = [job for job in self.jobs if self.asked.what == "image" or job.counts is not None]
        newest: dict[tuple[str, str, tuple[int, int]], Pictured] = {}
        for job in wanted:
            newest.setdefault((job.label, job.device, job.size), job)
        return sorted(newest.values(), key=lambda job: (_rank(job), job.label, job.device, job.size))


def read_asked(params: Mapping[str, str]) -> Asked:
    """Read a query string; raise PictureError, with one sentence, when it is wrong."""
    unknown = [name for name in params if name not in NAMES]
    if unknown:
        raise PictureError(f"Unknown parameter {unknown[0][:80]!r}: choose from {', '.join(NAMES)}.")
    return Asked(
        scene=params.get("scene") or None,
        study=_read_number(params, "study", MAX_ID),
        baseline=params.get("baseline") or None,
        against=params.get("against") or None,
        what=_read_word(params, "what", WHATS),
        view=_read_word(params, "view", VIEWS),
        cut=_read_number(params, "cut", 100, MIDDLE) or 0,
    )


def choose(session: Session, asked: Asked) -> Choice:
    """What a page shows; raise Problem 404 for a job that is named and has no picture."""
    named = [find_pictured(session, job) for job in (asked.baseline, asked.against) if job is not None]
    looked = list_pictured(session, study=asked.study)
    by_scene: dict[str, list[Pictured]] = defaultdict(list)
    for job in looked:
        by_scene[job.scene].append(job)
    scene = asked.scene or (named[0].scene if named else _default_scene(by_scene))
    jobs = list_pictured(session, scene=scene, study=asked.study) if scene is not None else []
    baseline, against = _pair(asked, named, scene, jobs)
    known = {job.job: job for job in (*jobs, *(job for job in (baseline, against) if job))}
    scenes = sorted({*by_scene, *([scene] if scene else [])})
    note = f"Only the newest {LOOKED_AT:,} results are looked at." if len(looked) == LOOKED_AT else ""
    ordered = sorted(known.values(), key=lambda job: -job.job)
    return Choice(asked, scene, scenes, ordered, baseline, against, note)


def _default_scene(by_scene: Mapping[str, Sequence[Pictured]]) -> str | None:
    """The scene with the newest picture among those that have two; else the one with the newest."""
    several = [scene for scene, jobs in by_scene.items() if len(jobs) > 1]
    return next(iter(several or by_scene), None)


def _pair(
    asked: Asked, named: Sequence[Pictured], scene: str | None, jobs: Sequence[Pictured]
) -> tuple[Pictured | None, Pictured | None]:
    """The two jobs; one that an address names beside another scene gives way to that scene's newest two."""
    by_id = {str(job.job): job for job in named if asked.scene is None or job.scene == scene}
    baseline, against = by_id.get(asked.baseline or ""), by_id.get(asked.against or "")
    if baseline is None and against is None:
        against = next((job for job in jobs if _others(jobs, job)), None) or next(iter(jobs), None)
    if baseline is None:
        baseline = _beside(jobs, against)
    elif against is None:
        against = _beside(jobs, baseline)
    return (against, None) if baseline is None else (baseline, against)


def _beside(jobs: Sequence[Pictured], one: Pictured | None) -> Pictured | None:
    """The newest job beside another, of its size where there is one."""
    different = [job for job in jobs if one is not None and job.job != one.job]
    return next(iter((one and _others(jobs, one)) or different), None)


def _others(jobs: Sequence[Pictured], one: Pictured) -> list[Pictured]:
    """The jobs of a job's size beside it."""
    return [job for job in jobs if job.job != one.job and job.size == one.size]


def _rank(job: Pictured) -> int:
    """A traversal's place among all of them; a label begins with it."""
    known, traversal = AXES["traversal"], job.label.partition(" ")[0]
    return known.index(traversal) if traversal in known else len(known)


def _read_word(params: Mapping[str, str], name: str, known: Mapping[str, str]) -> str:
    word = params.get(name) or next(iter(known))
    if word not in known:
        raise PictureError(f"Unknown {name} {word[:80]!r}: choose one of {', '.join(known)}.")
    return word


def _read_number(params: Mapping[str, str], name: str, most: int, default: int | None = None) -> int | None:
    text = params.get(name, "")
    if not text:
        return default
    if not (text.isascii() and text.isdigit() and len(text) < 12 and int(text) <= most):
        raise PictureError(f"The {name} {text[:80]!r} is not understood: give a number up to {most}.")
    return int(text)
