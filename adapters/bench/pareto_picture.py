"""Error against time as one picture, a panel a class, from the points of `pareto.py`; needs matplotlib.

Log axes. A point stands at an engine's median time and median error; a line to the right ends at its p99 time, one
upwards at its largest error. A ring and "n wrong" mark refuted booleans. What has no error to show stands on a line of
its own above the panel's errors, what has no time at its right border, each with the reason.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from collide.adapters.bench.bench_classes import CLASSES
from collide.adapters.bench.pareto import Point, quantile
from collide.base.whole_file import whole_file
from collide.errors import InvalidArgument, MissingExtra

#: Errors of 0 and below are drawn here.
FLOOR = 1e-18
#: Errors above this are drawn here: the answer has no right digit anyway.
CEILING = 10.0
#: Where points without any error stand: booleans alone.
NO_ERROR = 1e3
#: Okabe and Ito's colours, told apart by all, and three more; one an engine, settings by markers.
_COLOURS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6000", "#555555", "#A020F0", "#8B0000",
    "#00CED1",
)
#: Engines in a panel from which on it is drawn larger, to keep room for names.
CROWDED = 14
_MARKERS = "osD^vP*Xh"


def check_picture(place: str) -> None:
    """Refuse a picture that could not be written, before anything is measured."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
    except ImportError:
        raise MissingExtra("matplotlib", extra="plots", purpose="draw (--csv-only measures without)") from None
    known = sorted(FigureCanvasAgg.get_supported_filetypes())
    if Path(place).suffix[1:].lower() not in known:
        raise InvalidArgument(f"a picture must end in one of {', '.join('.' + kind for kind in known)}, got {place!r}")


def draw(points: list[Point], places: list[Path], stamp: dict[str, str]) -> list[dict]:
    """Write the picture to files; gives where everything stands: class, engine, x, y and the mark's text."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    for place in places:
        check_picture(str(place))
    kinds = list(dict.fromkeys(point.kind for point in points))
    columns = min(len(kinds), 3)
    lines = -(-len(kinds) // columns)
    stretch = 1.0 if len({point.engine for point in points}) < CROWDED else 1.45
    size = 5.4 * stretch * columns, 4.6 * stretch * lines + 0.9
    figure = Figure(figsize=size, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    styles = styles_of([point.engine for point in points])
    marks: list[dict] = []
    for panel, kind in zip(panels, kinds):
        marks += _panel(panel, [point for point in points if point.kind == kind], styles)
    for panel in panels[len(kinds) :]:
        panel.set_axis_off()
    figure.suptitle(
        "Signed distances: error against time. Point: medians; lines: to the p99 time and the largest error\n"
        f"{stamp['cpu']}, {stamp['cores']} cores, load {stamp['load']}, Python {stamp['python']}", fontsize=11,
    )
    for place in places:
        with whole_file(place) as file:
            figure.savefig(file, dpi=110, format=Path(place).suffix[1:].lower())
    return marks


def styles_of(engines: list[str]) -> dict[str, tuple[str, str]]:
    """Colour and marker of each engine:setting: a colour an engine, a marker a setting."""
    names = list(dict.fromkeys(engines))
    bases = list(dict.fromkeys(name.partition(":")[0] for name in names))
    settings = {base: [name for name in names if name.partition(":")[0] == base] for base in bases}
    return {
        name: (_COLOURS[bases.index(base) % len(_COLOURS)], _MARKERS[settings[base].index(name) % len(_MARKERS)])
        for name in names for base in [name.partition(":")[0]]
    }


def place_of(point: Point) -> tuple[float, float, str]:
    """x [µs], y, and the text of a point's mark; x is NaN where nothing could be timed."""
    error = quantile(point.error, 0.5)
    y = NO_ERROR if math.isnan(error) else min(max(error, FLOOR), CEILING)
    words = [point.engine]
    if point.wrong:
        words.append(f"{point.wrong} wrong" + (f", {point.wrong_apart} apart" if point.apart < point.pairs else ""))
    if point.failed:
        words.append(f"{point.failed} failed")
    if point.unsupported:
        words.append(f"{point.unsupported} n/a")
    return quantile(point.us, 0.5), y, " · ".join(words)


def _panel(panel: Any, points: list[Point], styles: dict[str, tuple[str, str]]) -> list[dict]:
    kind = points[0].kind
    panel.set_xscale("log")
    panel.set_yscale("log")
    marks: list[dict] = []
    silent: list[str] = []
    for point in points:
        x, y, text = place_of(point)
        marks.append({"class": kind, "engine": point.engine, "x": x, "y": y, "text": text})
        if math.isnan(x):
            silent.append(text)
            continue
        colour, marker = styles[point.engine]
        p99, worst = quantile(point.us, 0.99), quantile(point.error, 1.0)
        panel.plot([x, p99], [y, y], color=colour, lw=1.0, alpha=0.6, zorder=2)
        if not math.isnan(worst):
            panel.plot([x, x], [y, min(max(worst, FLOOR), CEILING)], color=colour, lw=1.0, alpha=0.6, zorder=2)
        panel.plot([x], [y], marker, color=colour, ms=7, mec="white", mew=0.6, zorder=4)
        if point.wrong or point.failed:
            panel.plot([x], [y], "o", mfc="none", mec="#C00000", mew=1.4, ms=13, zorder=3)
    _axes(panel, kind, points)
    _labels(panel, [mark for mark in marks if not math.isnan(mark["x"])], styles)
    if silent:
        panel.text(0.985, 0.985, "no answer:\n× " + "\n× ".join(silent), transform=panel.transAxes, ha="right",
                   va="top", fontsize=7, color="#C00000")
    return marks


def _axes(panel: Any, kind: str, points: list[Point]) -> None:
    timed = [value for point in points for share in (0.5, 0.99) if not math.isnan(value := quantile(point.us, share))]
    if timed:
        panel.set_xlim(min(timed) / 1.8, max(timed) * 4.0)
    panel.set_ylim(FLOOR / 1e4, NO_ERROR * 1e3)
    panel.axhspan(CEILING * 3, NO_ERROR * 1e3, color="#F3F3F3", zorder=0)
    band = "boolean only, or no number"
    panel.text(0.015, 0.985, band, transform=panel.transAxes, fontsize=7, va="top", color="#666")
    ticks = [FLOOR, 1e-16, 1e-12, 1e-8, 1e-4, 1.0]
    texts = ["0", *(f"{tick:.0e}".replace("e-0", "e-").replace("1e+00", "1") for tick in ticks[1:])]
    panel.set_yticks(ticks, texts)
    panel.minorticks_off()
    panel.grid(alpha=0.25, which="major", lw=0.6)
    panel.tick_params(labelsize=8)
    about = CLASSES[kind].about if kind in CLASSES else ""
    panel.set_title(f"{kind}: {about}\n{points[0].pairs} pairs, {points[0].apart} farther than 1e-12 from touching",
                    fontsize=8.5, loc="left")
    panel.set_xlabel("µs of CPU a call", fontsize=8)
    panel.set_ylabel("|distance − exact| / size", fontsize=8)


def _labels(panel: Any, marks: list[dict], styles: dict[str, tuple[str, str]]) -> None:
    """Names beside their points, moved up or down until no two overlap; a thin line leads back where one has moved."""
    panel.figure.canvas.draw()  # so that pixels are known
    forward = panel.transData.transform
    low_x, bottom = panel.transAxes.transform((0, 0))
    high_x, top = panel.transAxes.transform((1, 1))
    pixel = panel.figure.dpi / 72.0
    height = 9.5 * pixel
    taken: list[tuple[float, float, float, float]] = []
    for mark in marks:
        x, y = forward((mark["x"], mark["y"]))
        taken.append((x - 5 * pixel, y - 5 * pixel, x + 5 * pixel, y + 5 * pixel))
    for mark in sorted(marks, key=lambda m: (-m["y"], m["x"])):
        x, y = forward((mark["x"], mark["y"]))
        width = 4.4 * pixel * len(mark["text"]) + 4 * pixel
        spots = [(dx, dy * height) for dy in _steps(24) for dx in (8 * pixel, -8 * pixel - width)]
        free = [
            (dx, dy) for dx, dy in spots
            if low_x < x + dx and x + dx + width < high_x and bottom + height < y + dy < top - height
            and not any(_overlap((x + dx, y + dy - height / 2, x + dx + width, y + dy + height / 2), t) for t in taken)
        ]
        dx, dy = min(free or spots[:1], key=lambda spot: abs(spot[1]) + (6 * pixel if spot[0] < 0 else 0))
        taken.append((x + dx, y + dy - height / 2, x + dx + width, y + dy + height / 2))
        arrow = {"arrowstyle": "-", "lw": 0.5, "color": styles[mark["engine"]][0], "alpha": 0.7}
        panel.annotate(
            mark["text"], (mark["x"], mark["y"]), (dx / pixel, dy / pixel), textcoords="offset points", fontsize=7,
            va="center", ha="left", color=styles[mark["engine"]][0], arrowprops=arrow if abs(dy) > height else None,
            zorder=5, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.85},
        )


def _steps(n: int) -> list[float]:
    """0, 1, −1, 2, −2 …"""
    return [0.0, *(sign * k for k in range(1, n) for sign in (1.0, -1.0))]


def _overlap(a: tuple, b: tuple) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
