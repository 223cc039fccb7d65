"""A proposal as SRDF: what `Robot.load` and MoveIt read, with what it rests on in comments."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from xml.sax.saxutils import quoteattr

from collide.sweeps.pair_proposal import ADJACENT, ALWAYS, DEFAULT, NEVER, Proposal

_ABOUT = {
    ADJACENT: "joined by a joint, or through links without collision geometry",
    DEFAULT: "in collision at the default configuration (zeros, or the limits nearest to them)",
    ALWAYS: "in collision in every configuration of the sample",
    NEVER: "in collision in no configuration of the sample",
}


def srdf_text(proposal: Proposal, elements: Sequence[str] = ()) -> str:
    """The SRDF of a proposal.

    Parameters
    ----------
    proposal : Proposal
        Its disabled pairs are written, by reason.
    elements : sequence of str
        What stands before them, as XML: groups, states and end effectors of another SRDF of the robot.

    Returns
    -------
    str
        XML.
    """
    return "\n".join(_lines(proposal, elements)) + "\n"


def _lines(proposal: Proposal, elements: Sequence[str]) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    for line in _preface(proposal):
        yield f"<!-- {_in_comment(line)} -->"
    yield f"<robot name={quoteattr(proposal.robot.name)}>"
    yield from (f"  {element}" for element in elements)
    for reason, about in _ABOUT.items():
        pairs = [pair for pair in proposal.disabled if pair.reason == reason]
        if reason == ALWAYS and proposal.always_share < 1:
            about = f"in collision in at least {100 * proposal.always_share:g} % of the sample"
        if pairs:
            yield f"  <!-- {reason}: {about} -->"
        for pair in pairs:
            links = f"link1={quoteattr(pair.a)} link2={quoteattr(pair.b)}"
            yield f'  <disable_collisions {links} reason="{reason}"/>'
    yield "</robot>"


def _preface(proposal: Proposal) -> Iterator[str]:
    n = proposal.samples
    yield f"Proposed by `collide srdf` from {n:,} random configurations within the limits, seed {proposal.seed}."
    yield from never_words(proposal)


def never_words(proposal: Proposal) -> Iterator[str]:
    """What "Never" rests on, a sentence or two, as the file and the terminal say it."""
    never = [pair for pair in proposal.disabled if pair.reason == NEVER and not pair.fixed]
    if not never:
        return
    worst = max(pair.share_bounds[1] for pair in never)
    yield (
        f'A sample is no proof: a pair that is "Never" may still collide in up to 1 of {int(1 / worst):,} '
        "configurations (Wilson's bound, 95 % for each pair)."
    )
    gaps = [(pair.nearest.gap, pair) for pair in never if pair.nearest is not None]
    if gaps:
        gap, pair = min(gaps, key=lambda entry: entry[0])
        yield (
            "Each of them was searched downhill from its nearest samples as well; the least gap met is "
            f"{1e3 * gap:.3g} mm, of {pair.a} and {pair.b}."
        )


def _in_comment(text: str) -> str:
    """Comments of XML must not hold two hyphens in a row."""
    while "--" in text:
        text = text.replace("--", "- -")
    return text
