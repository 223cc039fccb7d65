"""Time and operations against size, two panels, from what `scaling.py` measured; needs matplotlib."""

from __future__ import annotations

import math
from pathlib import Path

from collide.adapters.bench.pareto_picture import check_picture, styles_of
from collide.adapters.bench.scaling import OPERATIONS, Growth
from collide.whole_file import whole_file


def draw(grown: list[Growth], places: list[Path], stamp: dict[str, str]) -> None:
    """Write the picture to files: µs by engine beside vertices a query looks at, slopes at the lines' ends."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    for place in places:
        check_picture(str(place))
    figure = Figure(figsize=(12.0, 5.2), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    times, counts = figure.subplots(1, 2, width_ratios=(2, 1))
    for panel, curves, unit in (
        (times, [g for g in grown if g.name != OPERATIONS], "µs a signed distance"),
        (counts, [g for g in grown if g.name == OPERATIONS], "vertices looked at, a support query"),
    ):  # fmt: skip
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.grid(alpha=0.25, which="major", lw=0.6)
        panel.set_xlabel("vertices of each hull", fontsize=9)
        panel.set_ylabel(unit, fontsize=9)
        _lines(panel, curves)
    figure.suptitle(
        "Hulls of n points on a sphere, apart, near and overlapping; slopes over the upper half of the sizes\n"
        f"{stamp['cpu']}, {stamp['cores']} cores, load {stamp['load']}", fontsize=10,
    )  # fmt: skip
    for place in places:
        with whole_file(place) as file:
            figure.savefig(file, dpi=110, format=Path(place).suffix[1:].lower())


def _lines(panel, grown: list[Growth]) -> None:
    """Curves, each named at its end; names that would overlap are moved up."""
    if not grown:
        return
    largest = max(n for g in grown for n in g.sizes)
    panel.set_xlim(min(n for g in grown for n in g.sizes) / 1.3, largest * 12)
    ends = []
    styles = styles_of([growth.name for growth in grown])
    for growth in grown:
        colour, marker = styles[growth.name]
        points = [(n, v) for n, v in zip(growth.sizes, growth.values) if math.isfinite(v)]
        if points:
            panel.plot(*zip(*points), marker + "-", ms=4, lw=1.3, color=colour)
            name = "" if growth.name == OPERATIONS else f"{growth.name}  "  # the axis names it
            ends.append((points[-1], f"{name}n^{growth.slope:.2f}", colour))
    panel.margins(y=0.12)
    panel.figure.canvas.draw()
    height, last = 11.0 * panel.figure.dpi / 72.0, -math.inf
    for (x, y), text, colour in sorted(ends, key=lambda end: end[0][1]):
        at = float(panel.transData.transform((x, y))[1])
        last = max(at, last + height)
        panel.annotate(text, (x, y), (8, (last - at) * 72.0 / panel.figure.dpi), textcoords="offset points",
                       fontsize=8, color=colour, va="center")  # fmt: skip
