"""The scenes that have a name: where each comes from, its licence, its fixed camera and its light."""

from __future__ import annotations

import difflib
from dataclasses import replace
from typing import Any

from scenes import places, procedural
from scenes.cornell import original_box
from scenes.entry import Download, Entry, SourceFile
from scenes.scene import Camera, SceneError

ARCHIVE = "https://casual-effects.com/data"
MODELS = "https://casual-effects.com/g3d/data10"
STANFORD = "http://graphics.stanford.edu/data/3Dscanrep/"
SCANS = "http://graphics.stanford.edu/pub/3Dscanrep"
UTAH = "http://www.sci.utah.edu/~wald/animrep/"

CC_BY = "CC BY 3.0"
SCAN_TERMS = (
    "Stanford scan terms: free for research use with credit to the Stanford Computer Graphics Laboratory,"
    " not for commercial use without permission"
)
BUDDHA_TERMS = f"{SCAN_TERMS}; a religious symbol, Stanford asks to avoid inappropriate uses"
OWN_RECONSTRUCTION = "own reconstruction from Stanford's range scans, not Stanford's happy_vrip"
STAND_IN = "procedural stand-in for Fairy Forest"

BOX_TRIANGLES = 12
STATUE_TRIANGLES = 100_008
RES3_SHA = "1ae6755fd78860baae9b54db8720dec506314f5a419b2294dded860f1a99b5ac"
BUNNY_SHA = "0df5ea5631a1cbd2d984b46ff672f1211850589bc016130d945739cac2d536b6"
DRAGON_SHA = "fea87ff48f2aba22fb53e7b67c3ff3f7b8c2a3b3a0653af62c48bba67c6d5744"
DABROVIC_SHA = "f109270c87e563790153e557890c1029eea4fda4ce360b4164fa8682627bd90d"
CONFERENCE_SHA = "034a0af3ca60340813c67b3405c84872282e5aa03fd818d26f9b2651f76ea47a"

CORNELL_BOX = Entry(
    name="cornell-box",
    title="Cornell box",
    source="G. Cardenas and M. McGuire, Williams College, 2011, McGuire Computer Graphics Archive",
    page=ARCHIVE,
    licence=CC_BY,
    triangles=36,
    # The symmetric view, which looks along edges; the light hangs below the lamp at y = 1.98.
    camera=Camera((0.0, 1.0, 3.9), (0.0, 1.0, 0.0), 40.0),
    lights=((0.0, 1.9, -0.03),),
    made=lambda _: original_box(),
)
HAPPY_BUDDHA = Entry(
    name="happy-buddha",
    title="Happy Buddha (own reconstruction)",
    source=f"Stanford Computer Graphics Laboratory's 48 range scans; {OWN_RECONSTRUCTION}",
    page=STANFORD,
    licence=BUDDHA_TERMS,
    triangles=1_087_716,
    camera=Camera((0.0, 0.16, 0.35), (0.0, 0.15, 0.0), 38.0),
    lights=((0.3, 0.4, 0.15),),
    normals="smooth",
    note=OWN_RECONSTRUCTION,
    get="no public address has it: put happy_recon_1088k.ply into a folder of RAYFARM_SCENES",
    files=(SourceFile("happy_recon_1088k.ply", "f80b0339b7b6564b9f094e796f22f123866e2b63331e73f1d18a881118e0f9f1"),),
)
HAPPY_BUDDHA_67K = replace(
    HAPPY_BUDDHA,
    name="happy-buddha-67k",
    title="Happy Buddha, Stanford's happy_vrip_res3",
    source="Stanford Computer Graphics Laboratory, happy_vrip_res3, 1996",
    triangles=67_240,
    note="Stanford's own third resolution",
    get="run rayfarm scenes fetch happy-buddha-67k",
    files=(
        SourceFile("happy_vrip_res3_67k.ply", "509d16d45c5144d79f29eb13a868bc1b75121319f235eba8ab69673d0fe554a9"),
        SourceFile("happy_vrip_res3.ply", RES3_SHA),
    ),
    download=Download(
        f"{SCANS}/happy/happy_recon.tar.gz", "happy_recon/happy_vrip_res3.ply", "happy_vrip_res3.ply", RES3_SHA
    ),
)
HAPPY_BUDDHA_VRIP = replace(
    HAPPY_BUDDHA_67K,
    name="happy-buddha-vrip",
    title="Happy Buddha, Stanford's happy_vrip",
    source="Stanford Computer Graphics Laboratory, happy_vrip, 1996",
    triangles=1_087_716,
    note="Stanford's own finest resolution",
    get="run rayfarm scenes fetch happy-buddha-vrip",
    files=(SourceFile("happy_vrip.ply"),),
    download=Download(f"{SCANS}/happy/happy_recon.tar.gz", "happy_recon/happy_vrip.ply", "happy_vrip.ply"),
)
CRYTEK_SPONZA = Entry(
    name="crytek-sponza",
    title="Crytek Sponza",
    source="F. Meinl, Crytek, 2010, after M. Dabrovic; McGuire Computer Graphics Archive",
    page=ARCHIVE,
    licence=CC_BY,
    triangles=262_267,
    camera=Camera((1100.0, 300.0, 0.0), (0.0, 350.0, -30.0), 60.0),
    lights=((0.0, 1000.0, 0.0),),
    normals="file",
    note="without the banner object sponza_04, as in the McGuire archive",
    get="run rayfarm scenes fetch crytek-sponza",
    files=(
        SourceFile("crytek_sponza_262k.ply", "0bcc2d3360429533024eca09ded4c64c5189718574fa06bd82d4d0a0594ee3e0"),
        SourceFile("crytek_sponza.obj"),
    ),
    # The checksum that is known is of Crytek's own archive, so McGuire's copy is checked by its count.
    download=Download(f"{MODELS}/common/model/crytek_sponza/sponza.zip", "sponza.obj", "crytek_sponza.obj"),
    drop=("sponza_04",),
)
DABROVIC_SPONZA = Entry(
    name="dabrovic-sponza",
    title="Dabrovic Sponza",
    source="M. Dabrovic, RNA studio, 2002; McGuire Computer Graphics Archive",
    page=ARCHIVE,
    licence="(c) 2002 M. Dabrovic, appears consistent with CC BY-NC (McGuire)",
    triangles=66_450,
    camera=Camera((11.0, 3.0, 0.0), (0.0, 3.5, -0.3), 60.0),
    lights=((0.0, 10.0, 0.0),),
    get="run rayfarm scenes fetch dabrovic-sponza",
    files=(
        SourceFile("dabrovic_sponza_66k.ply", "944ee16f35b275c3cfa2ba4e68cc15fa589929a2a77fe229104bbd1d31539811"),
        SourceFile("dabrovic_sponza.obj", DABROVIC_SHA),
    ),
    download=Download(
        f"{MODELS}/research/model/dabrovic_sponza/sponza.zip", "sponza.obj", "dabrovic_sponza.obj", DABROVIC_SHA
    ),
)
CONFERENCE = Entry(
    name="conference",
    title="Conference room",
    source="A. Grynberg and G. Ward, K. Lamar; McGuire Computer Graphics Archive",
    page=ARCHIVE,
    licence="listed as public domain by the archive's mirror",
    triangles=331_179,
    camera=Camera((1300.0, 400.0, 500.0), (300.0, 150.0, -200.0), 60.0),
    lights=((300.0, 560.0, -200.0),),
    get="run rayfarm scenes fetch conference",
    files=(
        SourceFile("conference_331k.ply", "b997dd52fd5ccff3db751144618d3946da99caea2135816da3e076c8f99fd4ef"),
        SourceFile("conference.obj", CONFERENCE_SHA),
    ),
    download=Download(
        f"{MODELS}/research/model/conference/conference.zip", "conference.obj", "conference.obj", CONFERENCE_SHA
    ),
)
FAIRY_FOREST = Entry(
    name="fairy-forest",
    title="Fairy Forest",
    source="Utah 3D Animation Repository",
    page=UTAH,
    licence="its terms do not allow redistribution",
    # The literature's figure; the file is known by its checksum, not by this.
    triangles=174_117,
    note="not redistributable; forest is its procedural stand-in",
    get=f"download it from {UTAH} as one OBJ and put that into a folder of RAYFARM_SCENES",
    files=(SourceFile("*.obj", "b433aa0fcd7f36eeb2219fa2ec5b9b14a5e1d9a0fdf5a75a3b5efb7266f79f68", size=15_579_692),),
)
DRAGON = Entry(
    name="stanford-dragon",
    title="Stanford Dragon",
    source="Stanford Computer Graphics Laboratory, dragon_vrip, 1996",
    page=STANFORD,
    licence=SCAN_TERMS,
    triangles=871_414,
    camera=Camera((0.0, 0.15, 0.31), (-0.005, 0.125, 0.0), 40.0),
    lights=((0.25, 0.4, 0.2),),
    normals="smooth",
    get="run rayfarm scenes fetch stanford-dragon",
    files=(
        SourceFile("dragon_vrip_871k.ply", "9c5f4c9a8ff466341e3fa2e5fbf811a031f9819c9c54ba3341c793cc9a26d4da"),
        SourceFile("dragon_vrip.ply", DRAGON_SHA),
    ),
    download=Download(
        f"{SCANS}/dragon/dragon_recon.tar.gz", "dragon_recon/dragon_vrip.ply", "dragon_vrip.ply", DRAGON_SHA
    ),
)
BUNNY = Entry(
    name="stanford-bunny",
    title="Stanford Bunny",
    source="Stanford Computer Graphics Laboratory, bun_zipper, 1994",
    page=STANFORD,
    licence=SCAN_TERMS,
    triangles=69_451,
    camera=Camera((-0.017, 0.15, 0.32), (-0.017, 0.11, 0.0), 38.0),
    lights=((0.25, 0.35, 0.15),),
    normals="smooth",
    get="run rayfarm scenes fetch stanford-bunny",
    files=(
        SourceFile("bunny_zipper_69k.ply", "360d4b3ecc9db608810a98cbc07a823c9250d5b50388a18fa97a8438d8318e0f"),
        SourceFile("bun_zipper.ply", BUNNY_SHA),
    ),
    download=Download(f"{SCANS}/bunny.tar.gz", "bunny/reconstruction/bun_zipper.ply", "bun_zipper.ply", BUNNY_SHA),
)
FOREST = Entry(
    name="forest",
    title=f"Forest ({STAND_IN})",
    source=f"made by RayFarm: {STAND_IN}",
    page="",
    licence="RayFarm's own",
    triangles=procedural.FOREST_TRIANGLES,
    camera=Camera(procedural.FOREST_EYE, (0.0, 1.4, 0.0), 60.0),
    lights=((7.0, 16.0, 5.0),),
    note=f"{STAND_IN}; forest:N asks for N triangles",
    made=procedural.forest,
    sized=True,
)
CORNELL_STATUE = replace(
    CORNELL_BOX,
    name="cornell-statue",
    title="Cornell box with a detailed closed surface",
    source=f"made by RayFarm, in the box by {CORNELL_BOX.source}",
    triangles=STATUE_TRIANGLES,
    normals="smooth",
    note="cornell-statue:N asks for about N triangles",
    made=procedural.statue,
    sized=True,
    boxed=True,
)


def _in_cornell_box(buddha: Entry, name: str) -> Entry:
    return replace(
        buddha,
        name=name,
        title=f"Cornell box with {buddha.title}",
        source=f"{buddha.source}; in the box by {CORNELL_BOX.source}",
        licence=f"{buddha.licence}; box {CORNELL_BOX.licence}",
        triangles=buddha.triangles + BOX_TRIANGLES,
        camera=CORNELL_BOX.camera,
        lights=CORNELL_BOX.lights,
        note=f"{buddha.note}; the placement in the box is RayFarm's choice",
        boxed=True,
    )


ENTRIES = {
    entry.name: entry
    for entry in (
        CORNELL_BOX,
        _in_cornell_box(HAPPY_BUDDHA, "cornell-buddha"),
        _in_cornell_box(HAPPY_BUDDHA_67K, "cornell-buddha-67k"),
        CORNELL_STATUE,
        CRYTEK_SPONZA,
        DABROVIC_SPONZA,
        CONFERENCE,
        FOREST,
        FAIRY_FOREST,
        HAPPY_BUDDHA,
        HAPPY_BUDDHA_67K,
        HAPPY_BUDDHA_VRIP,
        DRAGON,
        BUNNY,
    )
}


def find(name: str) -> Entry:
    """The entry called `name`; `forest:N` and `cornell-statue:N` ask for N triangles.

    SceneError where there is no such scene, with the names that come close.
    """
    base, colon, count = name.partition(":")
    entry = ENTRIES.get(base)
    if entry is None:
        raise SceneError(unknown(name))
    if not colon:
        return entry
    if not entry.sized:
        raise SceneError(f"{base} has a fixed triangle count: ask for plain {base}.")
    if not (count.isascii() and count.isdigit() and len(count) < 12):
        raise SceneError(f"{name!r} needs a whole number after the colon, as in {base}:50000.")
    return replace(entry, name=name, triangles=int(count))


def unknown(name: str) -> str:
    """One sentence for a name that is no scene."""
    close = difflib.get_close_matches(name.lower().partition(":")[0], ENTRIES, n=3, cutoff=0.5)
    meant = f"did you mean {' or '.join(close)}, or one of" if close else "choose one of"
    return f"There is no scene {name[:80]!r}: {meant} {', '.join(ENTRIES)}, or give a mesh file."


def list_scenes() -> list[dict[str, Any]]:
    """Every scene as name, title, triangles, licence, source, page, note, get, and whether it is `here`.

    Opens no geometry, except to hash a file that looks like Fairy Forest by its size.
    """
    shown = ("name", "title", "triangles", "licence", "source", "page", "note", "get")
    return [{key: getattr(entry, key) for key in shown} | {"here": is_here(entry)} for entry in ENTRIES.values()]


def is_here(entry: Entry) -> bool:
    """Whether the scene can be loaded without a download."""
    return entry.made is not None or places.find_source(entry) is not None
