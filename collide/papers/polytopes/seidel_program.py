"""Linear programs of few variables by Seidel's randomised incremental algorithm, in doubles."""

from __future__ import annotations

import numpy as np

#: Relative to the size of a row, what is taken for satisfied.
_TOLERANCE = 1e-12


def seidel_program(
    a: np.ndarray, b: np.ndarray, objective: np.ndarray, reach: float, rng: np.random.Generator
) -> np.ndarray | None:
    """A point x of {a·x ≤ b, |x| ≤ reach} with the largest objective·x; ``None`` where infeasible in doubles.

    Parameters
    ----------
    a : (m, d) float64
        Rows of any length; zero rows are read as 0 ≤ b.
    b : (m,) float64
        The right-hand side.
    objective : (d,) float64
        The vector of the objective.
    reach : float
        Half the edge of the bounding cube.
    rng : numpy Generator
        Gives the order of the rows.

    Returns
    -------
    (d,) float64 or ``None``
        The point, without a proof.

    Notes
    -----
    Seidel (1991), Small-dimensional linear programming and convex hulls made easy: rows come in random order; where the
    next row is violated the optimum lies on its plane, a program of d − 1 variables over the rows before it. Expected
    O(d! m). A single product finds the next violated row.
    """
    order = rng.permutation(len(b))
    return _solve(a[order], b[order], objective, np.full(len(objective), reach), rng)


def _solve(a, b, objective, reach, rng) -> np.ndarray | None:
    if len(objective) == 1:
        return _on_a_line(a[:, 0], b, objective[0], reach[0])
    sizes = np.abs(a) @ reach + np.abs(b)
    x = np.where(objective >= 0.0, reach, -reach)
    row = 0
    while True:
        violated = np.flatnonzero(a[row:] @ x - b[row:] > _TOLERANCE * sizes[row:])
        if not len(violated):
            return x
        row += int(violated[0])
        solved = _on_plane(a[row], b[row], a[:row], b[:row], objective, reach, rng)
        if solved is None:
            return None
        x = solved
        row += 1


def _on_a_line(a: np.ndarray, b: np.ndarray, objective: float, reach: float) -> np.ndarray | None:
    up, down = a > _TOLERANCE, a < -_TOLERANCE
    high = min(reach, float((b[up] / a[up]).min())) if up.any() else reach
    low = max(-reach, float((b[down] / a[down]).max())) if down.any() else -reach
    level = ~(up | down)
    if low > high + _TOLERANCE * (abs(low) + abs(high)) or (level.any() and b[level].min() < -_TOLERANCE * reach):
        return None
    return np.array([high if objective >= 0.0 else low])


def _on_plane(normal, offset, a, b, objective, reach, rng) -> np.ndarray | None:
    """The program on the plane normal·x = offset: the variable with the largest share is put for the others."""
    k = int(np.argmax(np.abs(normal)))
    if normal[k] == 0.0:
        return None
    rest = np.delete(np.arange(len(normal)), k)
    slope, level = -normal[rest] / normal[k], offset / normal[k]
    bounds = np.vstack((slope, -slope))  # |x_k| ≤ reach, written in the others
    rows = np.vstack((a[:, rest] + a[:, k : k + 1] * slope, bounds))
    right = np.concatenate((b - a[:, k] * level, (reach[k] - level, reach[k] + level)))
    solved = _solve(rows, right, objective[rest] + objective[k] * slope, reach[rest], rng)
    if solved is None:
        return None
    x = np.empty(len(normal))
    x[rest], x[k] = solved, level + slope @ solved
    return x
