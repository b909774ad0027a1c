"""Least squares over numbers that are not negative, with wishes of lower rank where the equations leave freedom."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

# Each rank of wishes weighs this much of the one before it, while the zeros are looked for.
_RANK = 0.1
_PASSES = 100
_PIVOTS = 200
_NOISE = 1e-9


def least_squares(equations: Array, values: Array, wishes: tuple[Array, ...]) -> Array:
    """The x >= 0 of least |equations x - values|, and among these of least |wishes[0] x|, then |wishes[1] x|, ....

    `equations` (m, n), `values` (m,), each of `wishes` (k, n). Which entries are zero is found with the wishes as light
    equations, whose bending of the others is taken out by adding what is missed to what is asked for, again and again
    (Bregman iteration; Osher et al. 2005). The rest is then solved for rank by rank.
    """
    solved = _bent(equations, values, wishes)
    free = solved > _NOISE
    ranked = np.zeros(len(solved))
    ranked[free] = _ranked(equations[:, free], values, tuple(wish[:, free] for wish in wishes))
    return ranked if ranked.min() >= -_NOISE else solved


def _bent(equations: Array, values: Array, wishes: tuple[Array, ...]) -> Array:
    """The same by light equations alone, so that ranks are not strict."""
    width = equations.shape[1]
    gram, light, weight = equations.T @ equations, np.zeros(width), 1.0
    start, freedom = _solve(equations, values)
    for wish in (*wishes, np.eye(width)):
        # Of a wish only what the equations leave open: the rest cannot be granted and would bend them.
        weight *= _RANK
        open_part = wish @ freedom @ freedom.T
        gram += weight**2 * open_part.T @ open_part
        light -= weight**2 * open_part.T @ (wish @ start)
    asked, solved, free = values, np.zeros(width), np.ones(width, bool)
    for _ in range(_PASSES):
        before = solved
        solved, free = _positive(gram, equations.T @ asked + light, free)
        asked = asked + values - equations @ solved
        if np.abs(solved - before).max() <= 1e-10 * max(float(solved.max()), 1.0):
            break
    return solved


def _positive(gram: Array, pull: Array, free: Flags) -> tuple[Array, Flags]:
    """The x >= 0 of least x' gram x / 2 - pull' x for a definite `gram`, and which entries may be positive.

    Block principal pivoting (Kim and Park 2011) from the guess `free`.
    """
    tolerance = 1e-12 * max(float(np.abs(pull).max()), 1.0)
    free = free.copy()
    fewest, patience = len(pull) + 1, 3
    for _ in range(_PIVOTS):
        solved = np.zeros(len(pull))
        solved[free] = np.linalg.solve(gram[np.ix_(free, free)], pull[free])
        wrong = np.where(free, solved < -tolerance, gram @ solved - pull < -tolerance)
        count = int(wrong.sum())
        if count == 0:
            break
        if count < fewest:
            fewest, patience = count, 3
        elif patience > 0:
            patience -= 1
        else:
            # The rule that ends cycles: change the last one alone.
            wrong[: np.flatnonzero(wrong)[-1]] = False
        free ^= wrong
    return np.maximum(solved, 0.0), free


def _ranked(equations: Array, values: Array, wishes: tuple[Array, ...]) -> Array:
    """Solve the equations, then use what freedom is left for each of the wishes in turn."""
    solved, free = _solve(equations, values)
    for wish in wishes:
        if free.shape[1] == 0:
            break
        step, still = _solve(wish @ free, -wish @ solved)
        solved = solved + free @ step
        free = free @ still
    return solved


def _solve(matrix: Array, side: Array) -> tuple[Array, Array]:
    """The shortest x of least |matrix x - side|, and an orthonormal basis (n, k) of what leaves it as it is."""
    width = matrix.shape[1]
    if 0 in matrix.shape:
        return np.zeros(width), np.eye(width)
    left, sizes, right = np.linalg.svd(matrix, full_matrices=True)
    rank = int((sizes > _NOISE * max(sizes[0], 1.0)).sum())
    inverse = right[:rank].T / sizes[:rank]
    return inverse @ (left[:, :rank].T @ side), right[rank:].T
