"""The text of an issue for a peer's tracker: what was asked, what it answered, what is true and why, how to see it."""

from __future__ import annotations

import json
from typing import Any

from collide.adapters.fuzzing.disagreements import Flaw
from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.fuzzing.proofs import expected_text
from collide.adapters.fuzzing.simpler_cases import degrees
from collide.adapters.peers.protocol import engine
from collide.adapters.peers.question import Body
from collide.shapes import Compound, ConvexHull, HPolytope, Mesh


def issue(flaw: Flaw, case: Case, about: dict[str, Any], snippet: str | None) -> str:
    """Markdown.

    about : as in a finding's scene file.   snippet : for the peer alone; None where it has no short form.
    """
    peer, known = engine(flaw.engine, isolated=False), about["exact"]
    name, version = next(iter(about["versions"].items()))
    lines = [f"# {title(flaw, case)}", "", f"{name} {version} ({peer.about}) is asked about", ""]
    lines += [f"- {letter}: {body_text(body)}" for letter, body in zip("AB", case.bodies)]
    lines += [f"- and {len(case.bodies) - 2} more bodies, of the scene file"] if len(case.bodies) > 2 else []
    lines += ["", f"It answers: **{answer_text(flaw)}**.", "", f"True is: **{expected_text(known)}**.", ""]
    if snippet is not None:
        lines += ["```python", snippet.rstrip(), "```", ""]
    else:
        lines += ["The numbers are in the scene file beside this text.", ""]
    lines += ["Versions: " + ", ".join(f"{name} {value}" for name, value in about["versions"].items()) + ".", ""]
    lines += [f"What it was given: {'; '.join(peer.receives)}.", ""] if peer.receives else []
    if known["certificate"] is not None:
        lines += [
            "<details><summary>Certificate</summary>", "", certificate_text(known), "", "```json",
            json.dumps(known["certificate"]), "```", "", "</details>", "",
        ]
    lines += [f"Found and shrunk by collide; `{about['command']}` shows it again."]
    return "\n".join(lines) + "\n"


def body_text(body: Body) -> str:
    """A shape and where it is, in a line."""
    shape, X_WB = body.shape, body.X_WB
    name = type(shape).__name__
    if isinstance(shape, Mesh):
        text = f"{name} of {len(shape.faces)} triangle{'s' * (len(shape.faces) > 1)}"
    elif isinstance(shape, Compound):
        text = f"{name} of {len(shape.items)} parts"
    elif isinstance(shape, ConvexHull):
        text = f"{name} of {len(shape.points)} points" + (f" and radius {shape.radius!r}" if shape.radius else "")
    elif isinstance(shape, HPolytope):
        text = f"{name} of {len(shape.offsets)} half-spaces"
    else:
        text = repr(shape)
    angles = dict(zip(("roll", "pitch", "yaw"), (float(f"{angle:.6g}") for angle in degrees(X_WB[:3, :3]))))
    turned = ", ".join(f"{name} {angle:g}°" for name, angle in angles.items() if angle)
    return f"{text} at {X_WB[:3, 3].tolist()}" + (f", turned by {turned}" if turned else "")


def title(flaw: Flaw, case: Case) -> str:
    """One line for a tracker."""
    names = " and ".join(case.kinds)
    place = {"touching": "touching", "inside": "one inside the other", "meeting": "meeting"}.get(
        flaw.position, {"near": "nearly touching", "shallow": "barely overlapping", "deep": "overlapping"}.get(
            flaw.position, "apart"))
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
    if "direction" in known["certificate"]:
        return (
            "`direction`: a unit vector n along which the bodies are `gap` apart, the least n·x over B less the "
            "greatest over A: the signed distance is no less, but for rounding. `points`: one on each body; bodies "
            "apart are no farther from each other than these are."
        )
    if isinstance(known["certificate"], list):
        return "Vertices as `collide.certificates.certificate` describes; `collide.verify` checks them in integers."
    return (
        "`vertices`: (vertex of A, vertex of B, weight) of the nearest points of the two hulls, radii left out; "
        "`axis`: a direction along which the hulls are exactly that far apart; `facet_normal`, `facet`: the nearest "
        "face of A − B where they overlap. All are exact, and found in integers."
    )
