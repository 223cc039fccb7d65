"""A proposal beside the disabled pairs of an SRDF: what both have, what only one has, and who is right."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from collide.pairs.query import distance
from collide.sweeps.link_bodies import link_bodies, link_poses, pair_hits
from collide.sweeps.pair_proposal import NEVER, LinkPair, Proposal
from collide.sweeps.random_configurations import random_configurations

#: Configurations in which adjacent links left out by an SRDF are asked, at most.
_MAX_SAMPLES = 1000


class PairDifference(NamedTuple):
    """A pair disabled by the proposal alone or by the SRDF alone.

    reason : of the disabling side.   share : share of the sample in which the pair collides.
    wrong : the SRDF says the pair never collides, and a collision was found.
    q, depth : a colliding configuration, and the depth of the collision [m]; ``None`` without a known collision.
    gap : the least gap [m] met, ``None`` without a search.
    always : links that move against each other collided in every configuration of the sample.
    """

    a: str
    b: str
    reason: str
    share: float
    wrong: bool
    q: np.ndarray | None
    depth: float | None
    gap: float | None
    always: bool = False


@dataclass
class PairComparison:
    """Disabled pairs of a proposal and of an SRDF.

    both : (a, b, our reason, their reason).
    only_theirs, only_ours : pairs of a single side.
    not_comparable : pairs of the SRDF with a link without collision geometry.
    """

    both: list[tuple[str, str, str, str]] = field(default_factory=list)
    only_theirs: list[PairDifference] = field(default_factory=list)
    only_ours: list[PairDifference] = field(default_factory=list)
    not_comparable: list[tuple[str, str]] = field(default_factory=list)

    @property
    def wrong(self) -> list[PairDifference]:
        """Pairs disabled by the SRDF as never colliding, with a collision within the limits."""
        return [pair for pair in self.only_theirs if pair.wrong]

    @property
    def left_out(self) -> list[PairDifference]:
        """Pairs tested with the SRDF though always in collision: with the SRDF no configuration is free."""
        return [pair for pair in self.only_ours if pair.always]


def compare_pairs(proposal: Proposal, theirs: Iterable[tuple[str, str, str]]) -> PairComparison:
    """A proposal beside (link, link, reason) of an SRDF.

    Parameters
    ----------
    proposal : Proposal
        Of the same robot.
    theirs : iterable of (str, str, str)
        As of `Robot.semantic_pairs`; reasons with or without "SRDF: " before them.

    Returns
    -------
    PairComparison
        Every pair of either of them once.
    """
    result, seen = PairComparison(), set()
    depth_of = _Depths(proposal)
    for a, b, reason in theirs:
        reason = reason.removeprefix("SRDF: ")
        pair = proposal.pair(a, b)
        if pair is None:
            result.not_comparable.append((a, b))
        elif (pair.a, pair.b) not in seen:
            seen.add((pair.a, pair.b))
            if pair.reason is not None:
                result.both.append((pair.a, pair.b, pair.reason, reason))
            else:
                # By any other reason, or without a reason, a person may have meant the pair.
                wrong = pair.q is not None and reason.lower() == NEVER.lower()
                result.only_theirs.append(_difference(pair, reason, wrong, depth_of))
    for pair in proposal.disabled:
        if (pair.a, pair.b) not in seen:
            asked = pair if pair.samples else _sampled(proposal, pair)
            result.only_ours.append(_difference(asked, pair.reason or "", False, depth_of))
    return result


def _difference(pair, reason: str, wrong: bool, depth_of: _Depths) -> PairDifference:
    depth = None if pair.q is None else depth_of(pair.a, pair.b, pair.q)
    gap = None if pair.nearest is None else pair.nearest.gap
    share = pair.hits / pair.samples if pair.samples else 0.0
    always = share == 1.0 and not pair.fixed  # links joined rigidly are not tested in any case
    return PairDifference(pair.a, pair.b, reason, share, wrong, pair.q, depth, gap, always)


def _sampled(proposal: Proposal, pair: LinkPair) -> LinkPair:
    """The pair with figures of a sample of its own: a proposal does not sample adjacent links."""
    bodies = {body.link: body for body in link_bodies(proposal.robot)}
    Q = random_configurations(proposal.robot, 0, min(_MAX_SAMPLES, proposal.samples), proposal.seed)
    hits = pair_hits(bodies[pair.a], bodies[pair.b], link_poses(proposal.robot, Q))
    q = Q[int(hits.argmax())] if hits.any() else None
    return replace(pair, samples=len(Q), hits=int(hits.sum()), q=q)


class _Depths:
    """How deep two links are in each other at a configuration: minus their signed distance."""

    def __init__(self, proposal: Proposal):
        self.robot = proposal.robot
        self.bodies = {body.link: body for body in link_bodies(proposal.robot)}

    def __call__(self, a: str, b: str, q: np.ndarray) -> float:
        A, B, poses = self.bodies[a], self.bodies[b], link_poses(self.robot, q[None])
        return -float(distance(A.shape, B.shape, poses.of(A)[0], poses.of(B)[0]).distance)
