"""A configuration explained: colliding pairs with their depths, the nearest pairs, joints outside their limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from collide.robots import open_pairs
from collide.robots.checker_scene import CheckerScene

#: What is nearer than this is listed where nothing collides [m].
_NEAR = 0.1
_MAX_LISTED = 8


class ExplainedPair(NamedTuple):
    """One pair of bodies.

    a, b : names.   distance, lower, upper : signed, with its proven bracket [m].   normal : (3,) from a towards b.
    point_a, point_b : (3,) in W [m].
    """

    a: str
    b: str
    distance: float
    lower: float
    upper: float
    normal: np.ndarray
    point_a: np.ndarray
    point_b: np.ndarray


@dataclass(frozen=True)
class ConfigurationReport:
    """Report on a configuration, printed by `str`.

    Parameters
    ----------
    q : (dof,) float64
    collisions, nearest : list of ExplainedPair
        Colliding pairs, deepest first; free pairs within 0.1 m, nearest first.
    notes : list of str
        Joints outside their limits.
    n_pairs : int
        Pairs of bodies tested.   skipped : {reason: pairs} never tested.
    robot : str
        Its name.
    """

    q: np.ndarray
    collisions: list[ExplainedPair]
    nearest: list[ExplainedPair]
    notes: list[str]
    n_pairs: int
    skipped: dict[str, int]
    robot: str

    @classmethod
    def of(cls, checker: CheckerScene, q: np.ndarray) -> ConfigurationReport:
        """The report about one configuration (dof,)."""
        X_WLs = checker.link_poses(q)
        pairs = _tested_pairs(checker)
        setting = checker.setting
        rows = open_pairs.distances(pairs, X_WLs, setting.bodies, setting.surroundings.bodies, limit=_NEAR)
        rows = rows[~rows["beyond"]]
        rows = rows[np.argsort(rows["distance"], kind="stable")]
        explained = [_explained(checker, row) for row in rows]
        hits = rows["hit"].tolist()
        return cls(
            q, [pair for pair, hit in zip(explained, hits) if hit],
            [pair for pair, hit in zip(explained, hits) if not hit], checker.robot.limit_notes(q), checker.n_pairs,
            checker.skipped, checker.robot.name,
        )

    @property
    def collides(self) -> bool:
        """Whether any tested pair meets."""
        return bool(self.collisions)

    def __str__(self) -> str:
        lines = [f"{self.robot}: {'in collision' if self.collides else 'free'} ({self.n_pairs} pairs tested)"]
        for title, pairs in (("collides", self.collisions), ("near", self.nearest)):
            lines += [f"  {title}: {_line(pair)}" for pair in pairs[:_MAX_LISTED]]
            if len(pairs) > _MAX_LISTED:
                lines.append(f"  {title}: {len(pairs) - _MAX_LISTED} more pairs")
        if not self.collisions and not self.nearest:
            lines.append(f"  nothing within {_NEAR:g} m")
        lines += [f"  {note}" for note in self.notes]
        lines += [f"  never tested: {count} pairs, {reason}" for reason, count in sorted(self.skipped.items())]
        return "\n".join(lines)


def _line(pair: ExplainedPair) -> str:
    away = f"{-pair.distance * 1e3:.6g} mm deep" if pair.distance <= 0.0 else f"{pair.distance * 1e3:.6g} mm apart"
    at = ", ".join(f"{x:.4g}" for x in pair.point_a)
    return f"{pair.a} and {pair.b}, {away}, at ({at}) m"


def _tested_pairs(checker: CheckerScene) -> np.ndarray:
    """(k, 3) of configuration 0, as `open_pairs.py` takes them."""
    a, k = np.nonzero(checker.setting.allowed == 0)
    around = np.stack([np.zeros_like(a), a, -1 - k], axis=1)
    pairs = checker.setting.self_pairs
    return np.concatenate([np.insert(pairs, 0, 0, axis=1), around]).astype(np.int64)


def _explained(checker: CheckerScene, row: np.ndarray) -> ExplainedPair:
    a, b = checker.names_of(int(row["a"]), int(row["b"]))
    return ExplainedPair(
        a, b, float(row["distance"]), float(row["lower"]), float(row["upper"]), row["normal"].copy(),
        row["point_a"].copy(), row["point_b"].copy(),
    )
