"""Findings drawn as one plate, a panel each: the two bodies, what the engine answers, what is true; needs matplotlib.

    collide fuzz --draw found/coal-*.json --picture plate.png
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from collide import distance
from collide.adapters.fuzzing.findings import Finding, load_finding
from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.fuzzing.issue_text import body_text
from collide.adapters.peers.question import bounds
from collide.base.whole_file import whole_file
from collide.errors import InvalidArgument, MissingExtra
from collide.shapes import tessellation

#: A and B, told apart by everybody: Okabe and Ito.
COLOURS = ("#0072B2", "#E69F00")
COLUMNS = 4
#: Characters of a line under a panel.
WIDTH = 54
_NUMBER = re.compile(r"-?\d+\.?\d*(?:e[-+]?\d+)?")


def draw_findings(files: Sequence[str | Path], picture: str | Path) -> int:
    """Draw findings, in the order given.

    Parameters
    ----------
    files : sequence of str or Path
        Scene files of `collide fuzz` or `collide compare --save`.
    picture : str or Path
        What to write: .png, .svg, .pdf.

    Returns
    -------
    int
        How many panels were drawn.

    Raises
    ------
    SceneError
        For a file that is no finding.
    InvalidArgument
        Where there is nothing to draw, and for a kind of picture that matplotlib cannot write.
    MissingExtra
        Where matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtra("matplotlib", extra="plots", purpose="draw findings") from None
    if Path(picture).suffix[1:].lower() not in FigureCanvasAgg.get_supported_filetypes():
        known = ", ".join(f".{kind}" for kind in sorted(FigureCanvasAgg.get_supported_filetypes()))
        raise InvalidArgument(f"a picture must end in one of {known}, got {str(picture)!r}")
    findings = [load_finding(place) for place in files]
    if not findings:
        raise InvalidArgument("there is no finding to draw")
    columns = min(COLUMNS, len(findings))
    lines = math.ceil(len(findings) / columns)
    figure = Figure(figsize=(3.7 * columns, 3.9 * lines), facecolor="white")
    FigureCanvasAgg(figure)
    figure.subplots_adjust(0.01, 0.31 / lines, 0.99, 1.0 - 0.03 / lines, wspace=0.04, hspace=0.46)
    for k, (finding, about) in enumerate(findings, 1):
        _panel(figure.add_subplot(lines, columns, k, projection="3d"), finding, about)
    with whole_file(picture) as file:
        figure.savefig(file, dpi=110, format=Path(picture).suffix[1:].lower())
    return len(findings)


def _panel(panel: Any, finding: Finding, about: dict[str, Any]) -> None:
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    case, size = finding.case, _extent(finding.case)
    for body, colour in zip(case.bodies, COLOURS):
        made = tessellation.tessellate(body.shape, size=2.0 * size)
        corners = (made.vertices @ body.X_WB[:3, :3].T + body.X_WB[:3, 3])[made.faces]
        panel.add_collection3d(Poly3DCollection(
            corners, facecolors=colour, alpha=0.4, shade=_has_areas(corners),
        ))
        ridges = _ridges(corners)
        if len(ridges):
            panel.add_collection3d(Line3DCollection(ridges, colors=colour, linewidths=0.9))
    _draw_gap(panel, case)
    middle = _boxes(case).reshape(-1, 3)
    middle = 0.5 * (middle.min(axis=0) + middle.max(axis=0))
    for axis, x in zip("xyz", middle):
        getattr(panel, f"set_{axis}lim")(x - 0.55 * size, x + 0.55 * size)
    panel.set_box_aspect((1, 1, 1), zoom=1.1)
    panel.view_init(elev=22, azim=-62)
    panel.set_axis_off()
    x, width = panel.get_position().x0, panel.get_position().y1
    panel.figure.text(x + 0.004, width, title(finding, about), va="top", fontsize=10, fontweight="bold")
    panel.figure.text(x + 0.004, panel.get_position().y0, "\n".join([*body_lines(case), answer_line(finding),
                      true_line(about)]), va="top", fontsize=8, linespacing=1.35)


def _has_areas(corners: np.ndarray) -> bool:
    """Whether every triangle has an area, so that light falls on it in some way."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return bool(len(corners) and np.linalg.norm(normals, axis=1).all())


def _ridges(corners: np.ndarray) -> np.ndarray:
    """(k, 2, 3) edges where triangles (n, 3, 3) meet at more than 25 degrees, or end."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    sides: dict[tuple, list[int]] = {}
    for k, triangle in enumerate(corners):
        ends = [tuple(np.round(corner, 12).tolist()) for corner in triangle]
        for i in range(3):
            sides.setdefault(tuple(sorted((ends[i], ends[(i + 1) % 3]))), []).append(k)
    flat = math.cos(math.radians(25.0))
    sharp = [edge for edge, of in sides.items() if len(of) != 2 or normals[of[0]] @ normals[of[1]] < flat]
    return np.array(sharp, dtype=float).reshape(-1, 2, 3)


def _draw_gap(panel: Any, case: Case) -> None:
    """The true nearest points of bodies apart, joined."""
    r = distance(*case.pair())
    if not r.hit and np.isfinite([r.point_a, r.point_b]).all():
        panel.plot(*np.array([r.point_a, r.point_b]).T, "k.-", linewidth=1.0, markersize=3)


def _boxes(case: Case) -> np.ndarray:
    """(k, 2, 3) boxes of what has an end."""
    boxes = np.array([bounds(body) for body in case.bodies[:2]])
    return boxes[np.isfinite(boxes).all(axis=(1, 2))]


def _extent(case: Case) -> float:
    """The longest edge of the box around both bodies [m]."""
    points = _boxes(case).reshape(-1, 3)
    return float((points.max(axis=0) - points.min(axis=0)).max()) or 1.0


def title(finding: Finding, about: dict[str, Any]) -> str:
    """Engine, version and kind of error."""
    return f"{finding.flaw.engine} {next(iter(about['versions'].values()))}: {finding.flaw.kind}"


def answer_line(finding: Finding) -> str:
    """What the engine answers, in a line."""
    flaw = finding.flaw
    if flaw.hit is None:
        return f"answers: nothing ({flaw.kind})"
    number = f", {flaw.distance:.6g} m" if flaw.distance is not None else ""
    points = "; nearest points exchanged" if "exchanged" in flaw.reason else ""
    return f"answers: {'collision' if flaw.hit else 'no collision'}{number}{points}"


def true_line(about: dict[str, Any]) -> str:
    """What is true, in a line."""
    known = about["exact"]
    if known["distance"] is not None:
        return f"true: {float(known['distance']):.6g} m, exact"
    lower, upper = known["lower"], known["upper"]
    if lower is None or upper is None:
        return f"true: {'overlap or touch' if known['hit'] else 'apart'}, {known['by']}"
    digits = next((n for n in range(17, 2, -1) if f"{lower:.{n}g}" == f"{upper:.{n}g}"), 0)
    number = f"{lower:.{min(digits, 6)}g}" if digits else f"{lower:.4g} … {upper:.4g}"
    return f"true: {number} m, proven"


def body_lines(case: Case) -> list[str]:
    """What A and B are, numbers at ten digits, poses in the origin left out."""
    A, B = (
        _NUMBER.sub(lambda match: f"{float(match[0]):.10g}", body_text(body)).replace(" at [0, 0, 0]", "")
        for body in case.bodies[:2]
    )
    named = [f"A and B, at one place: {A}"] if A == B else [f"A: {A}", f"B: {B}"]
    return [line for text in named for line in wrap(text, WIDTH, subsequent_indent="    ")]
