"""Which pairs of links need no test: adjacent, in collision always or at the default, or never in a sample."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief
from collide.robots.robot import Robot
from collide.sweeps.link_bodies import LinkBody, link_bodies, link_poses, moving_columns, pair_gaps, pair_hits
from collide.sweeps.pair_search import N_STARTS, Nearest, search_downhill
from collide.sweeps.random_configurations import random_configurations, unlimited_lengths

#: Why a pair is disabled, in the words of MoveIt's setup assistant.
ADJACENT, DEFAULT, ALWAYS, NEVER = "Adjacent", "Default", "Always", "Never"
#: Configurations whose poses are held at once.
_BATCH = 2000
#: Configurations of a proposal, at most: a thousand million, days.
_MAX_SAMPLES = 10**9
#: Configurations of which gaps are asked, to start the search from the nearest.
_N_GAPS = 1000
#: Quantile of the normal distribution for 95 % on one side.
_Z = 1.6448536269514722


@dataclass
class LinkPair:
    """Two links and the figures of a sample.

    Parameters
    ----------
    a, b : str
        Names, in the order of the robot's links.
    reason : str or ``None``
        "Adjacent", "Default", "Always" or "Never"; ``None`` where the pair has to be tested.
    samples, hits : int
        Number of configurations asked, and of collisions of the pair.
    fixed : bool
        The links cannot move against each other, so that a single configuration decides.
    q : (dof,) float64 or ``None``
        A colliding configuration, ``None`` where all met were free.
    searched : bool
        ``q`` was met on the way downhill, not in the sample.
    nearest : (gap, q) or ``None``
        The least gap [m] met and its configuration (dof,), of searched pairs.
    """

    a: str
    b: str
    reason: str | None = None
    samples: int = 0
    hits: int = 0
    fixed: bool = False
    q: np.ndarray | None = None
    searched: bool = False
    nearest: Nearest | None = None

    @property
    def share_bounds(self) -> tuple[float, float]:
        """Between what the share of configurations with a collision lies, each bound with 95 % confidence."""
        return (0.0, 1.0) if not self.samples else wilson_bounds(self.hits, self.samples)


@dataclass
class Proposal:
    """Pairs of links that need no test, and the sample behind.

    Parameters
    ----------
    robot : Robot
        Whose links.
    samples, seed : int
        Number of configurations drawn, and the seed.
    rounds : int
        Of the search downhill; 0 without a search.
    always_share : float
        Share of the sample in which an "Always" pair collides, at least.
    pairs : list of LinkPair
        All pairs of links with collision geometry, in the order of the links.
    notes : list of str
        Notes for the person who relies on the proposal.
    """

    robot: Robot
    samples: int
    seed: int
    rounds: int
    always_share: float
    pairs: list[LinkPair] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def disabled(self) -> list[LinkPair]:
        """The pairs that need no test, in the order of the links."""
        return [pair for pair in self.pairs if pair.reason is not None]

    def pair(self, a: str, b: str) -> LinkPair | None:
        """The figures of two links.

        Parameters
        ----------
        a, b : str
            Names of links, in either order.

        Returns
        -------
        LinkPair or ``None``
            ``None`` where either has no collision geometry.
        """
        wanted = {checks.text("Proposal.pair: a", a), checks.text("Proposal.pair: b", b)}
        return next((pair for pair in self.pairs if {pair.a, pair.b} == wanted), None)


def wilson_bounds(hits: int, samples: int) -> tuple[float, float]:
    """Wilson's bounds of a share, each with 95 % confidence: 0 of n hits leave up to about 2.7 / n open."""
    share, z2 = hits / samples, _Z * _Z
    middle = share + z2 / (2 * samples)
    spread = _Z * math.sqrt(share * (1 - share) / samples + z2 / (4 * samples * samples))
    return max(0.0, (middle - spread) / (1 + z2 / samples)), min(1.0, (middle + spread) / (1 + z2 / samples))


def propose_disabled_pairs(
    robot: Robot, samples: int = 10_000, *, seed: int = 0, rounds: int = 24, always_share: float = 1.0,
    progress: Callable | None = None,
) -> Proposal:
    """Pairs of links that need no test, found by sampling, as in MoveIt's setup assistant.

    Adjacent links (joined directly, or through links without geometry), then pairs that collide at the default
    configuration, in every sample, or in no sample. A pair free in all samples is searched besides: its nearest samples
    are followed downhill, and a pair colliding at the end is tested. "Never" is no proof: `LinkPair` has the bounds.

    Parameters
    ----------
    robot : Robot
        With collision geometry.
    samples : int
        Configurations drawn evenly within the limits, at least 1.
    seed : int
        Of the sample and of the search; the same seed gives the same proposal.
    rounds : int
        Of the search downhill, 0 without a search.
    always_share : float
        A pair colliding in at least this share of the sample is "Always" (MoveIt: 0.95).
    progress : callable, optional
        ``with progress(label) as rename``: called with each stage.

    Returns
    -------
    Proposal
        Every pair with its reason and its numbers.

    Raises
    ------
    InvalidArgument
        For a robot without two links with geometry, and for numbers out of range.
    """
    samples = checks.integer("samples", samples, 1)
    seed, rounds = checks.integer("seed", seed, 0), checks.integer("rounds", rounds, 0)
    checks.instance("propose_disabled_pairs: robot", robot, Robot, "a collide.Robot")
    share = checks.number(always_share)
    if share is None or not 0.5 <= share <= 1.0:
        raise InvalidArgument(f"always_share must be between 0.5 and 1, got {brief(always_share)}")
    if samples > _MAX_SAMPLES:
        raise InvalidArgument(f"samples must be at most {_MAX_SAMPLES:,}, got {brief(samples)}")
    if rounds > _MAX_SAMPLES:
        raise InvalidArgument(f"rounds must be at most {_MAX_SAMPLES:,}, got {brief(rounds)}")
    bodies = link_bodies(robot)
    if len(bodies) < 2:
        raise InvalidArgument(
            f"robot {robot.name}: {len(bodies)} of its links have collision geometry; pairs need two: "
            "look whether its meshes were read, and whether it has <collision> elements"
        )
    proposal = Proposal(robot, samples, seed, rounds, share, notes=list(robot.notes))
    if still := unlimited_lengths(robot):
        proposal.notes.append(f"not drawn, for these are lengths without limits: {', '.join(still)}")
    with (progress or _silent)(f"{robot.name}: sampling") as rename:
        _Survey(robot, bodies, proposal, rename or (lambda label: None)).run()
    return proposal


def _silent(label: str):
    return nullcontext()


class _Survey:
    """One run of `propose_disabled_pairs`."""

    def __init__(self, robot: Robot, bodies: list[LinkBody], proposal: Proposal, rename: Callable[[str], None]):
        self.robot, self.bodies, self.proposal, self.rename = robot, bodies, proposal, rename
        self.places = list(combinations(range(len(bodies)), 2))
        self.pairs = {(i, j): LinkPair(bodies[i].link, bodies[j].link) for i, j in self.places}
        self.columns = moving_columns(robot, bodies)
        proposal.pairs = list(self.pairs.values())

    def run(self) -> None:
        adjacent = adjacent_links(self.robot)
        at_default = link_poses(self.robot, self.robot.default_configuration()[None])
        for (i, j), pair in self.pairs.items():
            pair.fixed = not len(self.columns[i, j])
            if frozenset((pair.a, pair.b)) in adjacent:
                pair.reason = ADJACENT
            elif pair_hits(self.bodies[i], self.bodies[j], at_default)[0]:
                pair.reason, pair.q = DEFAULT, self.robot.default_configuration()
        self._sample()
        for pair in self.pairs.values():
            if pair.reason == ADJACENT:
                continue
            if pair.hits >= self.proposal.always_share * pair.samples:
                pair.reason = ALWAYS  # also pairs colliding at the default: "Always" says more
            elif pair.reason is None and pair.hits == 0:
                pair.reason = NEVER
        rare = [place for place, pair in self.pairs.items() if pair.reason == NEVER and not pair.fixed]
        for k, place in enumerate(rare if self.proposal.rounds else ()):
            pair = self.pairs[place]
            self.rename(f"{self.robot.name}: searching pair {k + 1} of {len(rare)}, {pair.a} and {pair.b}")
            self._search(place, pair)

    def _sample(self) -> None:
        asked = [place for place in self.places if self.pairs[place].reason != ADJACENT]
        drawn = self.proposal.samples
        for start in range(0, drawn, _BATCH):
            self.rename(f"{self.robot.name}: {start:,} of {drawn:,} configurations")
            Q = random_configurations(self.robot, start, min(start + _BATCH, drawn), self.proposal.seed)
            poses = link_poses(self.robot, Q)
            for i, j in asked:
                pair = self.pairs[i, j]
                if pair.fixed and start:
                    continue
                hits = pair_hits(self.bodies[i], self.bodies[j], poses if not pair.fixed else _first(poses))
                pair.samples += len(hits)
                pair.hits += int(hits.sum())
                if pair.q is None and hits.any():
                    pair.q = Q[int(hits.argmax())]

    def _search(self, place: tuple[int, int], pair: LinkPair) -> None:
        A, B = self.bodies[place[0]], self.bodies[place[1]]
        Q = random_configurations(self.robot, 0, min(_N_GAPS, self.proposal.samples), self.proposal.seed)
        gaps = pair_gaps(A, B, link_poses(self.robot, Q))
        starts = Q[np.argsort(gaps, kind="stable")[:N_STARTS]]
        pair.nearest = search_downhill(
            self.robot, A, B, self.columns[place], starts, self.proposal.rounds, self.proposal.seed
        )
        if pair.nearest.gap <= 0.0:
            pair.reason, pair.q, pair.searched = None, pair.nearest.q, True


def _first(poses):
    return poses._replace(X_WLs=poses.X_WLs[:1])


def adjacent_links(robot: Robot) -> set[frozenset[str]]:
    """Pairs of links joined by a joint; links without collision geometry are taken out and their neighbours joined.

    Parameters
    ----------
    robot : Robot
        Its tree.

    Returns
    -------
    set of frozenset of str
        Two links each, both with collision geometry.
    """
    beside: dict[str, set[str]] = {link: set() for link in robot.links}
    for joint in robot.joints:
        beside[joint.parent].add(joint.child)
        beside[joint.child].add(joint.parent)
    for link in robot.links:
        if link not in robot.geometry:
            neighbours = beside.pop(link)
            for neighbour in neighbours:
                beside[neighbour] |= neighbours
                beside[neighbour] -= {link, neighbour}
    return {frozenset((a, b)) for a, links in beside.items() for b in links}
