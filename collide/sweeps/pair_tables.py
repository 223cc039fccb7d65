"""A proposal of disabled pairs, and how it compares with an SRDF, as tables and as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from collide.reports.number_format import count, lengths
from collide.reports.tables import Column, Table
from collide.sweeps.pair_comparison import PairComparison, PairDifference
from collide.sweeps.pair_proposal import ADJACENT, ALWAYS, DEFAULT, NEVER, LinkPair, Proposal
from collide.sweeps.srdf_text import never_words

SCHEMA = "collide-srdf/1"
_WHAT = {
    ADJACENT: "joined by a joint, or through links without geometry",
    DEFAULT: "in collision at the default configuration",
    ALWAYS: "in collision in every configuration of the sample",
    NEVER: "in collision in none of them, and not on the way downhill from the nearest",
}
_A_AND_B = [Column("link A", "name"), Column("link B", "name")]


def summary(proposal: Proposal) -> str:
    """The verdict in a line."""
    disabled, pairs = len(proposal.disabled), len(proposal.pairs)
    return (
        f"{proposal.robot.name}: {disabled} of {count(pairs, 'pair')} of links need no test, {pairs - disabled} do; "
        f"{proposal.samples:,} configurations, seed {proposal.seed}"
    )


def proposal_tables(proposal: Proposal, everything: bool = False) -> list[Table]:
    """Pairs by reason, pairs whose collisions are hidden, and, with ``everything``, every pair."""
    tables = [_by_reason(proposal)]
    hidden = [pair for pair in proposal.disabled if pair.reason in (DEFAULT, ALWAYS) and pair.hits < pair.samples]
    if hidden:
        notes = ["They touch where the robot starts, so that a test would always fail there; disabled, it never does."]
        rows = [[pair.a, pair.b, _share(pair)] for pair in hidden]
        tables.append(Table("HIDDEN  disabled, and free in part of the sample", [*_A_AND_B, Column("collide in")], rows,
                            notes=notes))
    rare = [pair for pair in proposal.pairs if pair.searched]
    if rare:
        rows = [[pair.a, pair.b] for pair in rare]
        notes = [f"{pair.a} and {pair.b}: {state_words(pair.q)}" for pair in rare if pair.q is not None]
        tables.append(Table("RARE  collide, though in no configuration of the sample: tested", list(_A_AND_B), rows,
                            notes=notes))
    if everything:
        rows = [[pair.a, pair.b, pair.reason or "tested", _share(pair), _gap(pair)] for pair in proposal.pairs]
        columns = [*_A_AND_B, Column("reason", "label"), Column("collide in"), Column("least gap", optional=1)]
        tables.append(Table("PAIRS", columns, rows))
    return tables


def _by_reason(proposal: Proposal) -> Table:
    counts = {reason: sum(pair.reason == reason for pair in proposal.pairs) for reason in (*_WHAT, None)}
    rows = [[reason, str(counts[reason]), what] for reason, what in _WHAT.items()]
    rows.append(["tested", str(counts[None]), "collide in some configurations and not in others"])
    columns = [Column("reason", "label"), Column("pairs"), Column("", "text")]
    return Table("PAIRS OF LINKS", columns, rows, notes=list(never_words(proposal)))


def _share(pair: LinkPair) -> str:
    if not pair.samples:
        return ""
    if pair.fixed:
        return "all" if pair.hits else "none"
    if pair.hits == 0:
        return f"0 % (≤ {100 * pair.share_bounds[1]:.2g} %)"
    return f"{100 * pair.hits / pair.samples:.3g} %"


def _gap(pair: LinkPair) -> str:
    return "" if pair.nearest is None or pair.searched else lengths([pair.nearest.gap])[0].strip()


def state_words(q: np.ndarray) -> str:
    """A configuration as ``--state`` takes it."""
    return f"--state={','.join(f'{value:.5g}' for value in q.tolist())}"


def comparison_tables(comparison: PairComparison, place: str) -> list[Table]:
    """What only the SRDF at ``place`` disables, and what only the proposal does."""
    theirs = comparison.only_theirs
    tables = []
    columns = [
        *_A_AND_B, Column("its reason", "label"), Column("collide in", optional=2), Column("depth"),
        Column("verdict", "label"),
    ]
    if theirs:
        rows = [
            [pair.a, pair.b, pair.reason, f"{100 * pair.share:.3g} %", _depth(pair), "wrong" if pair.wrong else "meant"]
            for pair in theirs
        ]
        notes = ["wrong: it says that they never collide, and within the limits they do."]
        notes += [f"{pair.a} and {pair.b}: {state_words(pair.q)}" for pair in comparison.wrong if pair.q is not None]
        tables.append(Table(f"ONLY IN {place}", columns, rows, notes=notes))
    if comparison.left_out:
        rows = [[pair.a, pair.b, pair.reason, _depth(pair)] for pair in comparison.left_out]
        tables.append(Table(
            f"LEFT OUT OF {place}  collide in every configuration: with this file the robot is never free",
            [*_A_AND_B, Column("reason", "label"), Column("depth")], rows,
        ))
    if spared := [pair for pair in comparison.only_ours if not pair.always]:
        rows = [
            [pair.a, pair.b, pair.reason, f"{100 * pair.share:.3g} %",
             "" if pair.gap is None else lengths([pair.gap])[0].strip()]
            for pair in spared
        ]
        columns = [*_A_AND_B, Column("reason", "label"), Column("collide in"), Column("least gap", optional=1)]
        tables.append(Table(f"NOT IN {place}  tests of these pairs could be spared", columns, rows))
    return tables


def comparison_words(comparison: PairComparison, place: str) -> str:
    """Both in a line."""
    text = (
        f"{place}: {len(comparison.both)} pairs in both, {len(comparison.only_theirs)} only there "
        f"({len(comparison.wrong)} wrong), {len(comparison.only_ours)} only here"
    )
    if comparison.left_out:
        text += f" ({len(comparison.left_out)} of them always in collision)"
    left_out = len(comparison.not_comparable)
    return text + (f"; {count(left_out, 'pair')} with a link without collision geometry" if left_out else "")


def _depth(pair: PairDifference) -> str:
    return "" if pair.depth is None else lengths([pair.depth])[0].strip()


def to_dict(proposal: Proposal, comparison: PairComparison | None, place: str | None) -> dict[str, Any]:
    """Plain data for JSON: every pair, and the comparison where one was made."""
    data: dict[str, Any] = {
        "schema": SCHEMA, "robot": proposal.robot.name, "joints": list(proposal.robot.joint_names),
        "samples": proposal.samples, "seed": proposal.seed, "rounds": proposal.rounds, "notes": proposal.notes,
        "pairs": [_pair_dict(pair) for pair in proposal.pairs],
    }
    if comparison is not None:
        data["compared"] = {
            "with": place, "both": [list(row) for row in comparison.both],
            "only_theirs": [_difference_dict(pair) for pair in comparison.only_theirs],
            "only_ours": [_difference_dict(pair) for pair in comparison.only_ours],
            "not_comparable": [list(row) for row in comparison.not_comparable],
        }
    return data


def _pair_dict(pair: LinkPair) -> dict[str, Any]:
    low, high = pair.share_bounds
    return {
        "a": pair.a, "b": pair.b, "reason": pair.reason, "samples": pair.samples, "hits": pair.hits,
        "share_at_least": low, "share_at_most": high, "fixed": pair.fixed, "searched": pair.searched,
        "collide_at": None if pair.q is None else pair.q.tolist(),
        "least_gap": None if pair.nearest is None else pair.nearest.gap,
    }


def _difference_dict(pair: PairDifference) -> dict[str, Any]:
    return {**pair._asdict(), "q": None if pair.q is None else pair.q.tolist()}
