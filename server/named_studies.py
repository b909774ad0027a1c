"""The studies that have a name."""

from __future__ import annotations

from renderer.variant import AXES
from server.studies import Study
from server.study_axes import StudyError

BUDDHA_IN_THE_BOX = ("cornell-buddha", "cornell-buddha-67k", "cornell-statue")
FOREST = ("fairy-forest", "forest")

SPECIALISE = "specialise"

STUDIES: dict[str, Study] = {
    "demo": Study(
        text="The paper's four traversals and the stack, against Embree, on each scene.",
        scenes=("cornell-box", "forest"),
        first_here=(("crytek-sponza",),),
        axes={"traversal": "paper,bvh-stack", "method": "fragment", "layout": "normal"},
        size=(256, 256),
        frames=12,
        rounds=2,
        vs_embree=True,
    ),
    "paper": Study(
        text="What the paper's figures 3 to 11 show, with the paper's choices on every axis: methods, layouts and SAH "
        "costs by traversal and scene. It ends in a report that judges the paper's claims.",
        scenes=("cornell-box",),
        first_here=(BUDDHA_IN_THE_BOX, FOREST, ("crytek-sponza",)),
        axes={**dict.fromkeys(AXES, "paper"), "method": "fragment", "layout": "normal"},
        parts=(
            {"method": "paper"},
            {"layout": "paper"},
            {"sah": ("3.0,1.5", "1.5,3.0", "2.0,1.5", "6.0,1.5")},
        ),
        frames=8,
        rounds=4,
        # The paper's programs are general; specialised ones drop the normals in which its layouts differ.
        specialise=False,
        models=True,
    ),
    SPECIALISE: Study(
        text="What making plans for their scenes gains: each traversal specialised, and in the general form. It ends "
        "in a table of both: time, size, what was left out, and whether the hits are the same bits.",
        scenes=("cornell-box",),
        first_here=(("cornell-statue",), FOREST, ("crytek-sponza",)),
        axes={"traversal": "paper,bvh-stack", "method": "fragment", "layout": "normal", "specialise": ("off", "on")},
        size=(256, 256),
        frames=16,
        rounds=8,
    ),
    "aa": Study(
        text="One variant against itself: how often a comparison on a device raises a false alarm.",
        scenes=("cornell-box",),
        size=(64, 64),
        frames=90,
        rounds=10,
        repeats=80,
        check="none",
        axes={"layout": "normal"},
    ),
}


def require_study(name: str) -> Study:
    """A named study; raise StudyError naming those that exist."""
    if name not in STUDIES:
        raise StudyError(f"Unknown study {name!r}: choose one of {', '.join(STUDIES)}, or give scenes.")
    return STUDIES[name]
