"""A recommendation's verdict as sentences."""

from __future__ import annotations

from renderer.recommend.halving import Finalist, Terms, Verdict

MEGABYTE = 1e6


def write_verdict(found: Verdict, terms: Terms) -> str:
    """What to take and how sure that is, in a few sentences."""
    pick = found.pick
    if pick is None:
        return _nothing(found)
    sentences = [f"Take {pick.label}."]
    apart = [one for one in found.finalists[1:] if one.ratio.told_apart]
    alike = [one for one in found.finalists[1:] if not one.ratio.told_apart]
    if alike:
        sentences.append(_alike(pick, alike, terms))
    if apart:
        nearest = apart[0]
        sentences.append(f"{nearest.label} is {_slower(nearest)}.")
    if not found.finalists[1:] and not found.unconfirmed:
        sentences.append("Nothing else came near it within the budgets.")
    if found.unconfirmed:
        first = found.unconfirmed[0]
        sentences.append(
            f"{len(found.unconfirmed)} more could not be told apart from {first.leader} in the pilot and were "
            f"neither judged nor measured at the full size."
        )
    return " ".join(sentences)


def _alike(pick: Finalist, alike: list[Finalist], terms: Terms) -> str:
    names = " and ".join([pick.label, *(one.label for one in alike)])
    if all(one.ratio.low is None for one in alike):
        return f"{names} cannot be told apart by {terms.rounds} rounds: it takes more for an interval."
    larger = [one for one in alike if one.memory > pick.memory]
    text = f"{names} cannot be told apart"
    if larger:
        least = min(one.memory for one in larger)
        text += f"; {pick.label} uses less memory, {_size(pick.memory)} to {_size(least)}"
    return text + "."


def _slower(one: Finalist) -> str:
    ratio = one.ratio
    assert ratio.low is not None
    assert ratio.high is not None
    word = "slower" if ratio.ratio >= 1 else "faster"
    times = sorted(abs(value - 1) * 100 for value in (ratio.low, ratio.high))
    return f"{abs(ratio.ratio - 1) * 100:.0f} % {word} ({times[0]:.0f} to {times[1]:.0f} %)"


def _nothing(found: Verdict) -> str:
    reasons = []
    if found.over_error:
        least = min(one.wrong for one in found.over_error.values())
        reasons.append(f"{len(found.over_error)} are over the error budget, the best by {least:.1e} of its rays")
    if found.over_memory:
        least_bytes = min(found.over_memory.values())
        reasons.append(f"{len(found.over_memory)} are over the memory budget, the smallest with {_size(least_bytes)}")
    if found.failed:
        reasons.append(f"{len(found.failed)} could not run")
    return f"Nothing to recommend: {'; '.join(reasons) or 'there was nothing to measure'}."


def _size(count: int) -> str:
    return f"{count / MEGABYTE:.1f} MB"
