"""A rigid-body stepper for tests: bodies under gravity, held by the contacts of a `collide.World`.

Semi-implicit Euler: velocities first, then poses by the new ones. Contacts push by sequential impulses: every contact
in turn is given the impulse that mends its velocity, the sum is clamped to the friction cone, and the sweep is repeated
(E. Catto, "Iterative dynamics with temporal coherence", GDC 2005; K. Erleben, "Velocity-based shock propagation for
multibody dynamics animation", 2007: projected Gauss–Seidel on J M⁻¹ Jᵀ, which is the same sum in another order).
A contact with a gap may close it within the step and no more; of an overlap a fifth is undone a step. Impulses of the
last step are where the next one begins, contacts being known again by their features alone: no place is compared, so a
feature number that changed its meaning would throw the bodies about.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import collide

GRAVITY = np.array([0.0, 0.0, -9.81])
#: Part of an overlap that is undone in a step, and the greatest velocity [m/s] used for it.
MENDED, FASTEST = 0.2, 0.5
import os
CFM=float(os.environ.get('CFM','0.01')); MAXS=int(os.environ.get('MAXS','500'))

Key = tuple[int, ...]


class Step(NamedTuple):
    """What a step saw: keys of all contacts, the normal of each, the least distance, and the bodies' energy [J]."""

    keys: list[Key]
    normals: np.ndarray
    deepest: float
    energy: float


class Stepper:
    """n bodies that move and any that do not. add() them, then step(). Units: kg, m, s."""

    def __init__(self, dt: float = 1 / 60, margin: float = 2e-3, friction: float = 0.5, tolerance=1e-4,
                 max_contacts: int = 8, substeps: int = 4):
        self.dt, self.margin, self.friction, self.tolerance = dt, margin, friction, tolerance
        self.max_contacts, self.substeps = max_contacts, substeps
        self.world = collide.World()
        self.X = np.zeros((0, 4, 4))
        self.V = np.zeros((0, 6))  # linear, angular, in W
        self.mass = np.zeros(0)
        self.inertia = np.zeros((0, 3))  # about the bodies' own axes
        self.impulses: dict[Key, np.ndarray] = {}  # on B, in W

    def add(self, shape, X, mass: float = 0.0, inertia=(0.0, 0.0, 0.0), velocity=(0.0,) * 6) -> int:
        """A body whose centre of mass is its frame's origin, its axes principal; a mass of 0 stays where it is."""
        body = self.world.add(shape, X, static=mass == 0.0)
        self.X = np.concatenate([self.X, np.asarray(X, dtype=float)[None]])
        self.V = np.concatenate([self.V, np.array(velocity, dtype=float)[None]])
        self.mass, self.inertia = np.append(self.mass, mass), np.concatenate([self.inertia, [inertia]])
        return body

    def energy(self) -> float:
        """Kinetic and potential, of all that moves [J]."""
        spin = np.einsum("kji,kj->ki", self.X[:, :3, :3], self.V[:, 3:])
        moving = 0.5 * (self.mass * (self.V[:, :3] ** 2).sum(axis=1)).sum() + 0.5 * (self.inertia * spin**2).sum()
        return float(moving - self.mass @ (self.X[:, :3, 3] @ GRAVITY))

    def step(self) -> Step:
        """Contacts at the poses as they are, velocities, poses."""
        contacts = self.world.contacts(self.margin, max_contacts=self.max_contacts).rows
        keys = keys_of(contacts)
        axes = axes_of(contacts["normal"])
        J = self._jacobian(contacts, axes)
        JM = (J.reshape(len(J), -1, 1, 6) @ self._inverse_masses()).reshape(J.shape)  # each body's columns by its block
        A = JM @ J.T
        last = np.array([self.impulses.get(key, np.zeros(3)) for key in keys]).reshape(-1, 3)
        impulses = np.einsum("kij,kj->ki", axes, last).ravel()
        self.V[self.mass > 0, :3] += self.dt * GRAVITY
        gap = contacts["distance"]
        approach = J @ self.V.ravel()
        approach[::3] += np.maximum(np.where(gap > 0, gap, MENDED * gap) / self.dt, -FASTEST)
        self.n_sweeps = solve(A, approach, impulses, self.friction, self.tolerance*self.dt)
        self.V += (JM.T @ impulses).reshape(-1, 6)
        self._move(self.V,self.dt)
        self.world.set_poses(range(len(self.X)), self.X)
        self.impulses = dict(zip(keys, np.einsum("kij,ki->kj", axes, impulses.reshape(-1, 3))))
        return Step(keys, contacts["normal"], contacts["distance"].min(initial=np.inf), self.energy())

    def _jacobian(self, contacts, axes) -> np.ndarray:
        """(3k, 6n): velocities of B's point against A's along the axes of each contact."""
        middle = 0.5 * (contacts["point_a"] + contacts["point_b"])
        k = np.arange(len(contacts))
        if not len(k): return np.zeros((0, 6 * len(self.X)))
        J = np.zeros((len(k), 3, len(self.X), 6))
        for side, sign in (("a", -1.0), ("b", 1.0)):
            body = contacts[side]
            arm = middle - self.X[body, :3, 3]
            J[k, :, body, :3] = sign * axes
            J[k, :, body, 3:] = sign * np.cross(arm[:, None], axes)
        return J.reshape(3 * len(k), -1)

    def _inverse_masses(self) -> np.ndarray:
        """(n, 6, 6), zero of bodies that stay."""
        M = np.zeros((len(self.X), 6, 6))
        for k in np.flatnonzero(self.mass > 0):
            R = self.X[k, :3, :3]
            M[k, :3, :3] = np.eye(3) / self.mass[k]
            M[k, 3:, 3:] = R @ np.diag(1 / self.inertia[k]) @ R.T
        return M

    def _move(self, V: np.ndarray, h: float) -> None:
        """Poses by the velocities V; rotations by Rodrigues' formula, made orthogonal again."""
        for k in np.flatnonzero(self.mass > 0):
            turn = h * V[k, 3:]
            angle = np.linalg.norm(turn)
            K = np.cross(np.eye(3), turn)
            by = np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * K @ K
            U, _, Vt = np.linalg.svd(by @ self.X[k, :3, :3])
            self.X[k, :3, :3] = U @ Vt
            self.X[k, :3, 3] += h * V[k, :3]


def keys_of(contacts) -> list[Key]:
    """What a contact is known by: the bodies, their parts, and what of each meets."""
    fields = ["a", "b", "part_a", "part_b", "feature_a", "feature_b"]
    return list(zip(*(contacts[field].tolist() for field in fields)))


def axes_of(n: np.ndarray) -> np.ndarray:
    """(k, 3, 3): normals (k, 3) and two unit vectors across each."""
    e = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=1)])
    e /= np.linalg.norm(e, axis=1)[:, None]
    return np.stack([n, e, np.cross(n, e)], axis=1)


def solve(A: np.ndarray, approach: np.ndarray, x: np.ndarray, friction: float, tolerance: float) -> int:
    """Change impulses x so that A x + approach ≥ 0 along normals, within the friction cones; contacts in turn.

    A : (3k, 3k), normal and two vectors across it of each contact. O(k²) a sweep.
    """
    blocks = [
        (k, A[k : k + 3], approach[k : k + 3], A[k : k + 3, k : k + 3].tolist()) for k in range(0, len(x), 3)
    ]
    for sweep in range(MAXS):
        change = 0.0
        for k, rows, b, own in blocks if sweep % 2 == 0 else reversed(blocks):
            w, u, v = (rows @ x + b).tolist()
            n0, e0, f0 = x[k : k + 3].tolist()
            n = max(0.0, n0 - (w + CFM * own[0][0] * n0) / (own[0][0] * (1 + CFM)))
            e = e0 - (u + own[1][0] * (n - n0) + CFM * own[1][1] * e0) / (own[1][1] * (1 + CFM))
            f = f0 - (v + own[2][0] * (n - n0) + own[2][1] * (e - e0) + CFM * own[2][2] * f0) / (own[2][2] * (1 + CFM))
            across, most = (e * e + f * f) ** 0.5, friction * n
            if across > most:
                e, f = e * most / across, f * most / across
            x[k], x[k + 1], x[k + 2] = n, e, f
            change = max(change, abs(n - n0), abs(e - e0), abs(f - f0))
        if change <= tolerance: break
    return sweep+1