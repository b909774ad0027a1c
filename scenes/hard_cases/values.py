"""Rays whose numbers are special: NaN, infinity, signed zero, no length, odd lengths and limits."""

from __future__ import annotations

from functools import partial

import numpy as np

from scenes.hard_cases.case import FARTHEST, Family, HardCase, Random, case
from scenes.hard_cases.shapes import cube, directions, sphere, unit

SCENE = sphere(40, 0.0, 2.0)
EMBREE_NAN = "Embree tutorials/verify/verify.cpp, NaNTest (bar: 2.5 times an ordinary ray)"
EMBREE_INF = "Embree tutorials/verify/verify.cpp, InfTest (bar: 2.5 times an ordinary ray)"
BAR = 2.5


def special(random: Random, count: int, value: float, where: str) -> HardCase:
    """Rays inside a sphere with `value` in every component of the origin, the direction, both, or as the reach."""
    origin, way = cube(random, count), cube(random, count)
    reach = value if where == "reach" else FARTHEST
    if where in ("origin", "both"):
        origin += value
    if where in ("direction", "both"):
        way += value
    return case(SCENE, origin, way, reach)


def one_component(random: Random, count: int, value: float) -> HardCase:
    """`value` with either sign in one component alone, of the origin or of the direction."""
    parts = np.concatenate([cube(random, count), cube(random, count)], axis=1)
    signs = random.choice([-1.0, 1.0], count)
    parts[np.arange(count), random.integers(0, 6, count)] = value * signs
    return case(SCENE, parts[:, :3], parts[:, 3:])


def zeros(random: Random, count: int, *, origin: bool) -> HardCase:
    """One or two components of the direction are 0.0 or -0.0, and with `origin` some of the origin too."""
    start, way = cube(random, count), directions(random, count)
    for part in (way, start) if origin else (way,):
        still = np.arange(3) == random.integers(0, 3, (count, 1))
        still |= (np.arange(3) == random.integers(0, 3, (count, 1))) & (random.random((count, 1)) < 0.5)
        part[still] = np.copysign(0.0, random.choice([-1.0, 1.0], int(still.sum())))
    return case(SCENE, start, way)


def no_direction(random: Random, count: int) -> HardCase:
    """Directions of 0.0 and -0.0 in all components."""
    return case(SCENE, cube(random, count), np.copysign(0.0, cube(random, count)))


def limits(random: Random, count: int) -> HardCase:
    """Reaches about the wall: some ulps around it, 0, -0, negative, the smallest, infinite."""
    way = directions(random, count).astype(np.float32).astype(np.float64)
    near = np.float32(2.0) * (1.0 + random.integers(-4, 5, count) * 2.0**-23)
    odd = random.choice(np.array([0.0, -0.0, -1.0, 1e-45, 1e-38, 1e38, np.inf, -np.inf]), count)
    reach = np.where(random.random(count) < 0.5, near, odd)
    return case(SCENE, np.zeros((count, 3)), way, reach)


def lengths(random: Random, count: int, most: float) -> HardCase:
    """Directions of lengths from 2^-most to 2^most: t runs from 2^most to 2^-most."""
    way = directions(random, count) * 2.0 ** random.uniform(-most, most, (count, 1))
    return case(SCENE, cube(random, count), way)


def nearly_still(random: Random, count: int) -> HardCase:
    """Components about 2^-80, which the slab test takes for 0, and down to the smallest float32."""
    way = directions(random, count)
    small = np.arange(3) != random.integers(0, 3, (count, 1))
    power = np.where(
        random.random((count, 3)) < 0.5, random.uniform(-81, -79, (count, 3)), random.uniform(-149, -20, (count, 3))
    )
    return case(SCENE, cube(random, count), np.where(small, np.sign(way) * 2.0**power, np.sign(way)))


def any_bits(random: Random, count: int) -> HardCase:
    """Rays of random bits: every exponent, NaN and infinity among them."""
    bits = random.integers(0, 1 << 32, (count, 7), np.uint32).view(np.float32)
    half = random.random((count, 1)) < 0.5
    with np.errstate(invalid="ignore"):
        numbers = bits.astype(np.float64)
    origin = np.where(half, numbers[:, :3], cube(random, count))
    return case(SCENE, origin, np.where(half, unit(cube(random, count)), numbers[:, 3:6]), numbers[:, 6])


def _nan() -> tuple[Family, ...]:
    made: list[Family] = []
    for value, name, source in ((np.nan, "nan", EMBREE_NAN), (np.inf, "inf", EMBREE_INF)):
        for where in ("origin", "direction", "both", "reach"):
            does = "limits nothing" if (name, where) == ("inf", "reach") else "hits nothing, and soon"
            what = (
                f"{name} as its reach"
                if where == "reach"
                else f"{name} in {'origin and direction' if where == 'both' else where}"
            )
            make = partial(special, value=value, where=where)
            made.append(Family(f"{name}-{where}", f"A ray with {what} {does}.", source, make, bar=BAR))
    return tuple(made)


VALUES = (
    *_nan(),
    Family(
        "nan-component",
        "A single NaN must not be dropped by a min, a max or a comparison that is false for it.",
        "reone pull request 341; llnl/devil_ray issue 62; Luminary issue 32 (NaN visited every node)",
        partial(one_component, value=np.nan),
        bar=BAR,
    ),
    Family(
        "inf-component",
        "A single infinity turns slabs into 0 * inf.",
        "Embree tutorials/verify/verify.cpp, InfTest; NVIDIA/warp issue 1530",
        partial(one_component, value=np.inf),
        bar=BAR,
    ),
    Family(
        "zero-components",
        "0.0 and -0.0 in a direction divide to infinities of either sign.",
        "madmann91/bvh issues 9 and 20; tinybvh pull request 282; c-ray pull request 87",
        partial(zeros, origin=False),
    ),
    Family(
        "zero-everywhere",
        "0.0 and -0.0 in origin and direction together make 0 * inf where boxes have a face at 0.",
        "Williams et al. 2005; Embree InfTest (-0.0)",
        partial(zeros, origin=True),
    ),
    Family("no-direction", "A ray that goes nowhere hits nothing.", "reone pull request 341", no_direction, bar=BAR),
    Family(
        "limits",
        "A hit at the reach itself counts, one behind it does not; 0, negative and infinite reaches are answered.",
        "Embree NaNTest and InfTest (tnear, tfar)",
        limits,
    ),
    Family(
        "lengths",
        "Directions need not have length 1.",
        "pbrt-v4 shapes_test.cpp (rays to points are not normalised)",
        partial(lengths, most=20.0),
    ),
    Family(
        "extreme-lengths",
        "Directions from 2^-100 to 2^100 leave float32's range in products.",
        "clamp constants such as 1e30 of the field's reports",
        partial(lengths, most=100.0),
    ),
    Family(
        "nearly-still",
        "Components about the one that the slab test takes for 0, and down to the smallest number.",
        "c-ray pull request 111 (rays close to zero met all nodes)",
        nearly_still,
    ),
    Family(
        "garbage-rays",
        "Rays of random bits are answered.",
        "Embree tutorials/verify/verify.cpp, garbage",
        any_bits,
        bar=20.0,
    ),
)
