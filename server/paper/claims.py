"""The paper's claims: what each says, in words of our own, where, which figure shows it, and how it is judged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from server.paper.data import COSTS, TRAVERSALS, Costs, Section, costs_text
from server.paper.measures import ALU, DEPTH, MEMORY, NODES, PRIMITIVES, TRAFFIC, TRIANGLES
from server.paper.rule_best import Best, Groups, Named, fixed
from server.paper.rule_counts import Counts, MoreOnComplex
from server.paper.rule_every import Everywhere
from server.paper.rule_predicts import Predicts
from server.paper.rule_times import Ratio, Shift
from server.paper.sides import below_one, within_band
from server.paper.verdict import Finding


class Rule(Protocol):
    """How a claim is judged on one section."""

    def judge(self, section: Section) -> Finding:
        """The outcome with the figures behind it."""


@dataclass(frozen=True)
class Claim:
    """One claim. `where` is a place in the paper, `figure` its figure, `said` what it says there in other words."""

    key: str
    text: str
    where: str
    figure: int
    said: str
    rule: Rule


def _method(name: str) -> dict[str, str]:
    return {"method": name}


def _layout(name: str) -> dict[str, str]:
    return {"layout": name}


def _walk(name: str) -> dict[str, str]:
    return {"traversal": name}


def _named(field: str, names: tuple[str, ...]) -> Named:
    return {name: {field: name} for name in names}


def _one_traversal(name: str) -> Groups:
    others = tuple(other for other in TRAVERSALS if other != name)
    return fixed(_named("traversal", (name,)), _named("traversal", others))


def _pairs(pairs: list[Costs]) -> Named:
    return {f"SAH {costs_text(pair)}": {"sah": pair} for pair in pairs}


def _cheap_intersection(section: Section) -> tuple[Named, Named] | str:
    below = [pair for pair in section.sah_pairs() if pair[1] < pair[0]]
    others = [pair for pair in section.sah_pairs() if pair[1] >= pair[0]]
    if not below or not others:
        return "It takes SAH costs with the intersection below the traversal, and others."
    return _pairs(below), _pairs(others)


def _slightly(section: Section) -> tuple[Named, Named] | str:
    below = [pair for pair in section.sah_pairs() if pair[1] < pair[0]]
    nearest = [pair for pair in below if pair[0] / pair[1] == below[0][0] / below[0][1]]
    others = [pair for pair in below if pair not in nearest]
    if not others:
        return "It takes two SAH costs with the intersection below the traversal, by different ratios."
    return _pairs(nearest), _pairs(others)


def _settled(section: Section) -> tuple[Named, Named] | str:
    others = [pair for pair in section.sah_pairs() if pair != COSTS]
    if not others or COSTS not in section.sah_pairs():
        return f"It takes the SAH costs {costs_text(COSTS)} and others."
    return _pairs([COSTS]), _pairs(others)


def _lowest_by_highest(section: Section) -> tuple[Named, Named] | str:
    pairs = section.sah_pairs()
    if not pairs or pairs[0][0] / pairs[0][1] == pairs[-1][0] / pairs[-1][1]:
        return "It takes SAH costs of different ratios."
    return _pairs(pairs[:1]), _pairs(pairs[-1:])


_PUSH_DOWN, _BACKTRACK = "kd-push-down", "kd-backtrack"
_TRAIL, _PARENT_LINK = "bvh-restart-trail", "bvh-parent-link"
_NORMAL, _COMPACT, _SPLIT = (_layout(name) for name in ("normal", "compact", "split"))
_KD, _BVH = _named("traversal", (_PUSH_DOWN, _BACKTRACK)), _named("traversal", (_TRAIL, _PARENT_LINK))
_COMPACT_BY_NORMAL = fixed({"compact": _COMPACT}, {"normal": _NORMAL})

CLAIMS: tuple[Claim, ...] = (
    Claim(
        "hybrid-beats-fragment", "Hybrid is faster than fragment", "section 5", 3,
        "Rasterising what the eye sees and tracing shadow rays alone performs better than tracing all in a fragment "
        "shader.",
        Ratio(_method("hybrid"), _method("fragment"), "Frame time, hybrid by fragment"),
    ),
    Claim(
        "hybrid-beats-compute", "Hybrid is faster than compute", "section 5", 3,
        "The same against compute shaders.",
        Ratio(_method("hybrid"), _method("compute"), "Frame time, hybrid by compute"),
    ),
    Claim(
        "fragment-compute-equal", "Fragment and compute are about equal", "section 5", 3,
        "The two perform alike.",
        Ratio(_method("fragment"), _method("compute"), "Frame time, fragment by compute", within_band),
    ),
    Claim(
        "hybrid-best", "Hybrid is the best method overall", "abstract and section 5", 3,
        "Of the three methods hybrid is the one to choose on mobile devices.",
        Best(fixed(_named("method", ("hybrid",)), _named("method", ("fragment", "compute"))), each=True),
    ),
    Claim(
        "compact-not-always", "Compact is not always faster than normal", "section 6", 4,
        "Unpacking the normal takes instructions, so the compact layout is not better in every case.",
        Everywhere(
            _COMPACT,
            (("compact by normal", _NORMAL),),
            "Largest frame time of compact by normal in a cell",
            most=1.0,
            denied=True,
        ),
    ),
    Claim(
        "split-everywhere", "Split is similar or better everywhere", "section 6", 4,
        "The split layout gives similar or better results throughout.",
        Everywhere(
            _SPLIT,
            (("split by normal", _NORMAL), ("split by compact", _COMPACT)),
            "Largest frame time of split by another in a cell",
        ),
    ),
    Claim(
        "layout-on-complex", "The layout matters more on complex scenes", "section 6", 4,
        "More accesses to the geometry make the primitives' layout more important on complex scenes.",
        Shift(_SPLIT, (_NORMAL,), "Frame time of split by normal, complex scenes by small ones", below_one),
    ),
    Claim(
        "compact-smaller", "Compact takes less space for a primitive than normal", "section 3.1", 4,
        "A normal that goes into the vertices' padding makes a primitive smaller.",
        Counts((PRIMITIVES,), _COMPACT_BY_NORMAL, less=True, each=True),
    ),
    Claim(
        "compact-saves", "Compact saves bandwidth", "section 6", 5,
        "The compact layout needs less memory bandwidth than the normal one.",
        Counts(TRAFFIC, _COMPACT_BY_NORMAL, less=True, each=True),
    ),
    Claim(
        "split-saves", "Split saves bandwidth", "section 6", 5,
        "The split layout needs less memory bandwidth than the normal one.",
        Counts(TRAFFIC, fixed({"split": _SPLIT}, {"normal": _NORMAL}), less=True, each=True),
    ),
    Claim(
        "split-saves-most", "Split saves the most bandwidth", "section 6", 6,
        "Of the layouts, split needs the least bandwidth, since no normals are fetched with the vertices.",
        Counts(TRAFFIC, fixed({"split": _SPLIT}, {"normal": _NORMAL, "compact": _COMPACT}), less=True, each=True),
    ),
    Claim(
        "compact-alu", "Compact needs more instructions than normal", "section 6", 11,
        "Getting the stored normal out of the compact layout takes a few instructions more.",
        Counts(ALU, _COMPACT_BY_NORMAL, each=True),
    ),
    Claim(
        "complex-more-accesses", "Complex scenes need more memory accesses", "section 6", 9,
        "More complex scenes need more accesses; here nodes and primitives together.",
        MoreOnComplex(MEMORY),
    ),
    Claim(
        "complex-more-primitives", "Complex scenes need more accesses to primitives", "section 6", 9,
        "The same sentence read as the accesses to primitives alone.",
        MoreOnComplex((TRIANGLES,)),
    ),
    Claim(
        "push-down-excels", "Push-down is the fastest with few primitives", "section 7.1", 7,
        "KD push-down excels on scenes with few primitives.",
        Best(_one_traversal(_PUSH_DOWN), scenes="few"),
    ),
    Claim(
        "push-down-deteriorates", "Push-down deteriorates with many primitives", "section 7.1", 7,
        "Its standing quickly gets worse as the geometry gets more complex.",
        Shift(
            _walk(_PUSH_DOWN),
            tuple(_walk(name) for name in TRAVERSALS if name != _PUSH_DOWN),
            "Frame time of push-down by the others' mean, complex scenes by small ones",
            each=False,
        ),
    ),
    Claim(
        "trail-best-complex", "Trail is the fastest on complex scenes", "section 7.1", 7,
        "BVH trail performs better on more complex scenes.",
        Best(_one_traversal(_TRAIL), scenes="complex"),
    ),
    Claim(
        "trail-best", "Trail is the fastest over all scenes", "section 7.1", 7,
        "The best results came from BVH trail, ahead of KD backtrack and BVH parent-link.",
        Best(_one_traversal(_TRAIL)),
    ),
    Claim(
        "backtrack-parent-link-equal", "Backtrack and parent-link are about equal", "section 7.1", 7,
        "KD backtrack and BVH parent-link give results similar to each other.",
        Ratio(
            _walk(_BACKTRACK), _walk(_PARENT_LINK), "Frame time, backtrack by parent-link", within_band, each=False
        ),
    ),
    Claim(
        "push-down-worst", "Push-down is the slowest over all scenes", "section 7.1", 7,
        "Its instructions and its bandwidth together give KD push-down the worst performance of all.",
        Best(_one_traversal(_PUSH_DOWN), worst=True),
    ),
    Claim(
        "nodes-predict", "Nodes traversed predict speed", "section 7.1", 8,
        "The number of nodes traversed goes with the performance.",
        Predicts((NODES,)),
    ),
    Claim(
        "nodes-strongest", "Nodes limit speed more than ALU and memory do", "section 7.1", 8,
        "ALU, memory accesses and bandwidth all limit, but the number of nodes traversed does so the most.",
        Predicts((NODES,), (ALU, MEMORY)),
    ),
    Claim(
        "push-down-most-nodes", "Push-down traverses the most nodes", "section 7.1", 8,
        "KD push-down takes more nodes and steps than the others.",
        Counts((NODES,), _one_traversal(_PUSH_DOWN)),
    ),
    Claim(
        "kd-more-memory", "KD-trees read more memory than BVHs", "section 7.1", 9,
        "The algorithms on KD-trees use more memory bandwidth than those on BVHs.",
        Counts(MEMORY, fixed(_KD, _BVH)),
    ),
    Claim(
        "memory-predicts", "Structures that read less memory are faster", "abstract and section 7.1", 9,
        "The structures that keep memory bandwidth low perform better.",
        Predicts(MEMORY),
    ),
    Claim(
        "backtrack-fewest-alu", "Backtrack needs the fewest ALU instructions", "section 7.1", 11,
        "KD backtrack does not sort children by distance and needs the fewest instructions.",
        Counts(ALU, _one_traversal(_BACKTRACK), less=True),
    ),
    Claim(
        "push-down-most-alu", "Push-down needs the most ALU instructions", "section 7.1", 11,
        "KD push-down has the most instructions a fragment.",
        Counts(ALU, _one_traversal(_PUSH_DOWN)),
    ),
    Claim(
        "alu-predicts", "Fewer ALU instructions mean faster, backtrack excepted", "section 7.1", 11,
        "Traversals with fewer instructions a fragment perform better, but for KD backtrack.",
        Predicts(ALU, without=_BACKTRACK),
    ),
    Claim(
        "backtrack-excepted", "Backtrack is slower than trail all the same", "section 7.1", 11,
        "With the fewest instructions KD backtrack is still not the fastest: its memory traffic slows it down.",
        Ratio(_walk(_TRAIL), _walk(_BACKTRACK), "Frame time, trail by backtrack", each=False),
    ),
    Claim(
        "intersection-below", "An intersection cost below the traversal cost is best", "section 7.2", 10,
        "Trees built with the intersection cheaper than the traversal perform best.",
        Best(_cheap_intersection, each=True),
    ),
    Claim(
        "slightly-below", "Only slightly below is best", "section 7.2", 10,
        "The traversal should cost only slightly more than the intersection; no ratio is given, here it is the least "
        "above 1.",
        Best(_slightly, each=True),
    ),
    Claim(
        "settled-costs", "SAH costs 3.0, 1.5 do best", "sections 3.2.1, 3.2.2", 10,
        "Traversal 3.0 and intersection 1.5 give good results for KD-trees and for BVHs.",
        Best(_settled, each=True),
    ),
    Claim(
        "shallow-best", "Wider, shallower trees are faster", "sections 3.2.1, 3.2.2", 10,
        "Mobile architectures tend to favour wide, shallow trees.",
        Predicts((DEPTH,), by_costs=True),
    ),
    Claim(
        "cheap-traversal-more-nodes", "A lower traversal cost means more nodes traversed", "section 7.2", 10,
        "A smaller cost of traversal makes every pixel traverse more nodes.",
        Counts((NODES,), _lowest_by_highest, each=True),
    ),
    Claim(
        "sah-nodes-predict", "Nodes traversed predict speed among SAH costs", "section 7.2", 10,
        "The figures for the SAH costs again show that fewer nodes traversed go with better performance.",
        Predicts((NODES,), by_costs=True),
    ),
)  # fmt: skip
