"""How figures grow: lines and powers fitted to rows, and pictures of them, a line a group of rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from collide.adapters.bench.pareto_picture import check_picture
from collide.base.whole_file import whole_file

Row = dict[str, Any]
Figure = str | Callable[[Row], float]


class Fit(NamedTuple):
    """y ≈ start + slope·x, off by `off` at most; y ≤ above + slope·x everywhere."""

    start: float
    slope: float
    off: float
    above: float


class Panel(NamedTuple):
    """A panel of a picture: y over x, columns or functions of a row, a line a value of the column `by`.

    log : axes with a logarithmic scale, "", "x", "y" or "xy".   where : which rows.
    dashed : a second figure over the same x.   floor : what values of 0 are drawn at.
    """

    title: str
    x: Figure
    y: Figure
    by: str
    log: str = "x"
    where: Callable[[Row], bool] = bool
    dashed: Figure | None = None
    x_label: str = ""
    y_label: str = ""
    floor: float = 0.0
    style: str = "o-"


def value(row: Row, figure: Figure) -> float:
    """A column, or a function of it; NaN where there is none."""
    number = figure(row) if callable(figure) else row.get(figure, "")
    return float(number) if number not in ("", None) else math.nan


def line_fit(x: Any, y: Any) -> Fit:
    """Least squares."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    slope, start = np.polyfit(x, y, 1)
    over = y - slope * x
    return Fit(float(start), float(slope), float(np.abs(over - start).max()), float(over.max()))


def power_of(x: Any, y: Any) -> float:
    """e of y ~ xᵉ, least squares of the logarithms."""
    return line_fit(np.log(np.asarray(x, dtype=float)), np.log(np.asarray(y, dtype=float))).slope


def groups(rows: list[Row], *by: str) -> Iterator[tuple[tuple, list[Row]]]:
    """Rows by what stands in some columns, in order."""
    for key in dict.fromkeys(tuple(row.get(name) for name in by) for row in rows):
        yield key, [row for row in rows if tuple(row.get(name) for name in by) == key]


def log2_lines(rows: list[Row], by: tuple[str, ...], figures: tuple[str, ...], x: Figure = "n", of: str = "log2 n",
               least: int = 3) -> Iterator[str]:
    """A line of text a group and figure: figure = a + b·log2 x, and how far the farthest row is off."""
    for key, some in groups(rows, *by):
        if len({value(row, x) for row in some}) >= least:
            logs = np.log2([value(row, x) for row in some])
            for name in figures:
                fit = line_fit(logs, [value(row, name) for row in some])
                yield (f"{' '.join(map(str, key))}: {name} = {fit.start:.1f} + {fit.slope:.2f}·{of}, at most "
                       f"{fit.off:.1f} off; all ≤ {fit.above:.1f} + {fit.slope:.2f}·{of}")


def draw(rows: list[Row], panels: tuple[Panel, ...], place: Path) -> None:
    """One picture of some panels, side by side, up to four in a row.

    Raises MissingExtra without matplotlib, InvalidArgument for a kind of file that it does not write.
    """
    check_picture(str(place))
    from matplotlib.figure import Figure as Sheet

    wide = min(4, len(panels))
    high = -(-len(panels) // wide)
    sheet = Sheet(figsize=(4.6 * wide, 3.8 * high), layout="constrained")
    axes = np.atleast_1d(sheet.subplots(high, wide)).ravel()
    for axis, panel in zip(axes, panels):
        for (name,), some in groups([row for row in rows if panel.where(row)], panel.by):
            x = [value(row, panel.x) for row in some]
            y = [max(value(row, panel.y), panel.floor) for row in some]
            (line,) = axis.plot(x, y, panel.style, label=str(name), markersize=4)
            if panel.dashed is not None:
                axis.plot(x, [value(row, panel.dashed) for row in some], "o--", color=line.get_color(), markersize=3)
        axis.set(title=panel.title, xlabel=panel.x_label or (panel.x if isinstance(panel.x, str) else ""),
                 ylabel=panel.y_label, xscale="log" if "x" in panel.log else "linear",
                 yscale="log" if "y" in panel.log else "linear")
        axis.title.set_fontsize(9)
        axis.grid(alpha=0.3)
        if axis.has_data():
            axis.legend(fontsize=7)
    for axis in axes[len(panels) :]:
        axis.set_axis_off()
    place.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(place) as file:
        sheet.savefig(file, dpi=110, format=place.suffix[1:].lower())
