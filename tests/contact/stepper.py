"""A rigid-body stepper for tests: bodies under gravity, held by the contacts of a `collide.World`.

Contacts are asked for once a step. The step is then cut into substeps of semi-implicit Euler, velocities first and
poses by the new ones, in which contacts push by sequential impulses: each in turn is given the impulse that mends its
velocity, and the sum is clamped to the friction cone (E. Catto, "Iterative dynamics with temporal coherence", GDC
2005). One sweep a substep is enough, since substeps are small (M. Macklin et al., "Small steps in physics simulation",
SCA 2019). A contact with a gap may close it within the substep and no more; an overlap is pushed out by a damped
spring, and a second sweep takes back the velocity that the spring gave ("soft step": E. Catto, "Solver2D", 2024).

Impulses of the last step are where the next one begins, contacts being known again by their features alone: no place is
compared, so a feature number that changed its meaning would throw the bodies about.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import collide

GRAVITY = np.array([0.0, 0.0, -9.81])
#: The spring of overlaps: its frequency [1/s] and its damping, in parts of the critical one; the greatest speed [m/s].
HERTZ, DAMPING, FASTEST = 60.0, 10.0, 0.5

Key = tuple[int, ...]


class Step(NamedTuple):
    """What a step saw, and made of it.

    contacts : rows, at the poses before it.   keys : of each.
    X : (n, 4, 4), V : (n, 6), energy [J] : of the bodies after it.
    """

    contacts: np.ndarray
    keys: list[Key]
    X: np.ndarray
    V: np.ndarray
    energy: float


class Stepper:
    """n bodies that move and any that do not. add() them, then step(). Units: kg, m, s."""

    def __init__(self, dt=1 / 60, substeps=8, margin=2e-3, friction=0.5, max_contacts=8):
        self.dt, self.substeps, self.margin, self.friction = dt, substeps, margin, friction
        self.max_contacts = max_contacts
        self.world = collide.World()
        self.X = np.zeros((0, 4, 4))
        self.V = np.zeros((0, 6))  # linear, angular, in W
        self.mass = np.zeros(0)
        self.inertia = np.zeros((0, 3))  # about the bodies' own axes
        self.impulses: dict[Key, np.ndarray] = {}  # on B, in W

    def add(self, shape, X, mass=0.0, inertia=(1.0, 1.0, 1.0), velocity=(0.0,) * 6) -> int:
        """A body whose centre of mass is its frame's origin, its axes principal; a mass of 0 stays where it is."""
        body = self.world.add(shape, X, static=mass == 0.0)
        self.X = np.concatenate([self.X, np.asarray(X, dtype=float)[None]])
        self.V = np.concatenate([self.V, np.array(velocity, dtype=float)[None]])
        self.mass, self.inertia = np.append(self.mass, mass), np.concatenate([self.inertia, [inertia]])
        return body

    def energy(self) -> float:
        """Kinetic and potential, of all that moves [J]."""
        spin = np.einsum("kji,kj->ki", self.X[:, :3, :3], self.V[:, 3:])
        kinetic = self.mass @ (self.V[:, :3] ** 2).sum(axis=1) + (self.inertia * spin**2).sum()
        return float(0.5 * kinetic - self.mass @ (self.X[:, :3, 3] @ GRAVITY))

    def step(self) -> Step:
        """Contacts at the poses as they are, then the substeps, poses."""
        contacts = self.world.contacts(self.margin, max_contacts=self.max_contacts).rows
        keys, axes = keys_of(contacts), axes_of(contacts["normal"])
        J = self._jacobian(contacts, axes)
        JM = (J.reshape(len(J), len(self.X), 1, 6) @ self._inverse_masses()).reshape(J.shape)  # by blocks of bodies
        blocks = blocks_of(JM @ J.T)
        last = np.array([self.impulses.get(key, np.zeros(3)) for key in keys]).reshape(-1, 3)
        x = np.einsum("kij,kj->ki", axes, last).ravel()
        h = self.dt / self.substeps
        moved = np.zeros(self.V.size)
        for _ in range(self.substeps):
            self.V[self.mass > 0, :3] += h * GRAVITY
            free = (J @ self.V.ravel()).tolist()
            push, softness = spring(contacts["distance"] + (J @ moved)[::3], h)
            sweep(blocks, free, push.tolist(), softness.tolist(), x, self.friction)
            moved += h * (self.V.ravel() + x @ JM)
            sweep(blocks[::-1], free, np.maximum(push, 0.0).tolist(), [0.0] * len(keys), x, self.friction)
            self.V += (x @ JM).reshape(-1, 6)
        self._move(moved.reshape(-1, 6))
        self.impulses = dict(zip(keys, np.einsum("kij,ki->kj", axes, x.reshape(-1, 3))))
        return Step(contacts, keys, self.X.copy(), self.V.copy(), self.energy())

    def _jacobian(self, contacts, axes) -> np.ndarray:
        """(3k, 6n): velocities of B's point against A's along the axes of each contact."""
        middle = 0.5 * (contacts["point_a"] + contacts["point_b"])
        k = np.arange(len(contacts))
        J = np.zeros((len(k), 3, len(self.X), 6))
        for side, sign in (("a", -1.0), ("b", 1.0)):
            body = contacts[side]
            arm = middle - self.X[body, :3, 3]
            J[k, :, body, :3] = sign * axes
            J[k, :, body, 3:] = sign * np.cross(arm[:, None], axes)
        return J.reshape(3 * len(k), 6 * len(self.X))

    def _inverse_masses(self) -> np.ndarray:
        """(n, 6, 6), zero of bodies that stay."""
        M = np.zeros((len(self.X), 6, 6))
        for k in np.flatnonzero(self.mass > 0):
            R = self.X[k, :3, :3]
            M[k, :3, :3] = np.eye(3) / self.mass[k]
            M[k, 3:, 3:] = R @ np.diag(1 / self.inertia[k]) @ R.T
        return M

    def _move(self, moved: np.ndarray) -> None:
        """Poses moved and turned (n, 6); rotations by Rodrigues' formula, made orthogonal again."""
        for k in np.flatnonzero(self.mass > 0):
            turn = moved[k, 3:]
            angle = np.linalg.norm(turn)
            K = np.cross(np.eye(3), turn)
            by = np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * K @ K
            U, _, Vt = np.linalg.svd(by @ self.X[k, :3, :3])
            self.X[k, :3, :3] = U @ Vt
            self.X[k, :3, 3] += moved[k, :3]
        self.world.set_poses(range(len(self.X)), self.X)


def keys_of(contacts) -> list[Key]:
    """What each contact is known by: the bodies, their parts, and what of each meets."""
    fields = ["a", "b", "part_a", "part_b", "feature_a", "feature_b"]
    return list(zip(*(contacts[field].tolist() for field in fields)))


def axes_of(n: np.ndarray) -> np.ndarray:
    """(k, 3, 3): normals (k, 3) and two unit vectors across each."""
    e = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=1)])
    e /= np.linalg.norm(e, axis=1)[:, None]
    return np.stack([n, e, np.cross(n, e)], axis=1)


def spring(gap: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """(k,) the speed that each contact must not fall below, negated, and how soft it is: 0 of gaps, which are hard."""
    omega = 2.0 * np.pi * min(HERTZ, 0.25 / h)
    damped = 2.0 * DAMPING + h * omega
    return np.where(gap > 0.0, gap / h, np.maximum(omega / damped * gap, -FASTEST)), (gap <= 0.0) / (h * omega * damped)


class Block(NamedTuple):
    """A contact's three rows of A (`sweep`), and the part of them that is its own."""

    at: int
    rows: np.ndarray
    own: list[list[float]]


def blocks_of(A: np.ndarray) -> list[Block]:
    return [Block(i, A[i : i + 3], A[i : i + 3, i : i + 3].tolist()) for i in range(0, len(A), 3)]


def sweep(blocks: list[Block], free: list[float], push, softness, x: np.ndarray, friction: float) -> None:
    """Change impulses x (3k,), contact by contact, so that A x + free + push ≥ 0 along normals, in the friction cones.

    A : (3k, 3k), normal and two vectors across it of each contact.   softness : of a contact's own mass, added to it.
    """
    for i, rows, ((nn, _, _), (en, ee, ef), (fn, _, ff)) in blocks:
        w, u, v = (rows @ x).tolist()
        n0, e0, f0 = x[i : i + 3].tolist()
        soft = softness[i // 3]
        n = max(0.0, n0 - (w + free[i] + push[i // 3] + soft * nn * n0) / (nn * (1.0 + soft)))
        inverse_mass = max(ee, ff) + abs(ef)  # one for both, or what slides would not be held against its direction
        e = e0 - (u + free[i + 1] + en * (n - n0)) / inverse_mass
        f = f0 - (v + free[i + 2] + fn * (n - n0)) / inverse_mass
        across, most = (e * e + f * f) ** 0.5, friction * n
        if across > most:
            e, f = e * most / across, f * most / across
        x[i : i + 3] = n, e, f
