"""The text of an issue for a peer's tracker: what was asked, what it answered, what is true and why, how to see it."""

from __future__ import annotations

import json
from typing import Any

from collide.adapters.fuzzing.disagreements import Flaw
from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.fuzzing.proofs import expected_text


def issue(flaw: Flaw, case: Case, about: dict[str, Any], snippet: str | None) -> str:
    """Markdown.

    about : as in a finding's scene file.   snippet : for the peer alone; None where it has no short form.
    """
    names = " and ".join(case.kinds)
    lines = [f"# {title(flaw, case)}", ""]
    lines += [f"`{flaw.engine}` is asked about a {names}. It answers: **{answer_text(flaw)}**.", ""]
    lines += [f"True is: **{expected_text(about['exact'])}**.", ""]
    if snippet is not None:
        lines += ["```python", snippet.rstrip(), "```", ""]
    else:
        lines += ["The numbers are in the scene file beside this text.", ""]
    lines += ["Versions: " + ", ".join(f"{name} {value}" for name, value in about["versions"].items()) + ".", ""]
    if about["exact"]["certificate"] is not None:
        lines += [
            "<details><summary>Certificate</summary>", "", certificate_text(about["exact"]), "", "```json",
            json.dumps(about["exact"]["certificate"]), "```", "", "</details>", "",
        ]  # fmt: skip
    lines += [f"Found and shrunk by collide; `{about['command']}` shows it again."]
    return "\n".join(lines) + "\n"


def title(flaw: Flaw, case: Case) -> str:
    """One line for a tracker."""
    names = " and ".join(case.kinds)
    place = {"touching": "touching", "inside": "one inside the other", "meeting": "meeting"}.get(
        flaw.position, {"near": "nearly touching", "shallow": "barely overlapping", "deep": "overlapping"}.get(
            flaw.position, "apart"))  # fmt: skip
    return f"{flaw.kind.capitalize()}: {names}, {place}"


def answer_text(flaw: Flaw) -> str:
    """What an engine answered, in a few words."""
    if flaw.hit is None:
        return f"nothing: {flaw.reason or flaw.kind}"
    word = "a collision" if flaw.hit else "no collision"
    number = f", distance {flaw.distance!r} m" if flaw.distance is not None else ""
    return word + number + (f" ({flaw.reason})" if flaw.reason else "")


def certificate_text(known: dict[str, Any]) -> str:
    """How to read a certificate."""
    if isinstance(known["certificate"], list):
        return "Vertices as `collide.certificates.certificate` describes; `collide.verify` checks them in integers."
    return (
        "`vertices`: (vertex of A, vertex of B, weight) of the nearest points of the two hulls, radii left out; "
        "`axis`: a direction along which the hulls are exactly that far apart; `facet_normal`, `facet`: the nearest "
        "face of A − B where they overlap. All are exact, and found in integers."
    )
