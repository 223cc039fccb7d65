"""The pictures of docs/accuracy.md, from the rows of `benchmarks/accuracy.py`; needs matplotlib."""

from __future__ import annotations

from pathlib import Path

_COLOURS = {"collide": "#1b6ca8", "coal": "#d1495b", "fcl": "#6a994e"}
#: Errors of 0 are drawn here.
_FLOOR = 2e-17
#: Levels in the picture of error against time, with their markers.
_LEVELS = {"1e-01": "o", "1e-04": "s", "1e-08": "^", "1e-12": "D"}
#: Settings in the picture of error against gap.
_SETTINGS = (
    ("collide", "signed", "-"), ("coal", "default", "-"), ("coal", "1e-09", "--"), ("coal", "1e-12", ":"),
    ("fcl", "default", "-"),
)  # fmt: skip


def plot(part: str, rows: list[dict], base: Path) -> list[Path]:
    """Draw what belongs to one part; returns the files."""
    import matplotlib

    matplotlib.use("Agg")
    base.parent.mkdir(parents=True, exist_ok=True)
    drawn = {"time": _against_time, "gaps": _against_gap} if part == "time" else {"curved": _widths}
    places = []
    for name, draw in drawn.items():
        figure = draw(rows)
        place = base.with_name(f"{base.stem}-{name}{base.suffix or '.png'}")
        figure.savefig(place, dpi=90)
        places.append(place)
    return places


def _grid(rows: list[dict], title: str):
    """A figure with a column a size and a row a side, and the rows that belong to each."""
    import matplotlib.pyplot as plt

    sizes = list(dict.fromkeys(r["n"] for r in rows))
    sides = list(dict.fromkeys(r["side"] for r in rows))
    figure, axes = plt.subplots(
        len(sides), len(sizes), figsize=(3.6 * len(sizes), 6.4), sharex=True, sharey=True, squeeze=False
    )
    figure.suptitle(title, fontsize=11)
    cells = []
    for i, side in enumerate(sides):
        for j, n in enumerate(sizes):
            axis = axes[i][j]
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.set_ylim(_FLOOR / 2, 1e4)
            axis.grid(alpha=0.25, which="major")
            axis.set_title(f"{side}s, {n:,} vertices", fontsize=9)
            axis.tick_params(labelsize=8)
            cells.append((axis, [r for r in rows if (r["side"], r["n"]) == (side, n)]))
        axes[i][0].set_ylabel("largest relative error", fontsize=8)
    return figure, axes, cells


def _error(r: dict) -> float:
    return min(max(float(r["max_error"]), _FLOOR), 1e4)


def _against_time(rows: list[dict]):
    from matplotlib.lines import Line2D

    figure, axes, cells = _grid(rows, "Error against time: coal at its default and at tolerances 1e-3 … 1e-12")
    for axis, cell_rows in cells:
        for level, marker in _LEVELS.items():
            for engine, colour in _COLOURS.items():
                at = [r for r in cell_rows if (r["level"], r["engine"]) == (level, engine)]
                if not at:
                    continue
                x, y = [r["min_us"] for r in at], [_error(r) for r in at]
                axis.scatter(x, y, s=46 if engine == "collide" else 16, marker=marker, color=colour, alpha=0.85, lw=0)
    for axis in axes[-1]:
        axis.set_xlabel("µs a pair, least of the repeats", fontsize=8)
    engines = [Line2D([], [], marker="o", ls="", color=c, label=e) for e, c in _COLOURS.items()]
    levels = [
        Line2D([], [], marker=m, ls="", color="grey", label=f"{float(v):.0e} of the length") for v, m in _LEVELS.items()
    ]
    figure.legend(handles=[*engines, *levels], loc="lower center", ncols=4, fontsize=8, frameon=False)
    figure.tight_layout(rect=(0, 0.07, 1, 1))
    return figure


def _against_gap(rows: list[dict]):
    figure, axes, cells = _grid(rows, "Error against gap and depth")
    for axis, cell_rows in cells:
        for engine, setting, style in _SETTINGS:
            at = [r for r in cell_rows if (r["engine"], r["setting"]) == (engine, setting)]
            if at:
                label = engine if setting in ("signed",) else f"{engine} {setting}"
                axis.plot(
                    [float(r["level"]) for r in at],
                    [_error(r) for r in at],
                    style,
                    color=_COLOURS[engine],
                    label=label,
                    marker=".",
                    lw=1.3,
                )
    axes[0][0].invert_xaxis()  # they share it
    for axis in axes[-1]:
        axis.set_xlabel("gap or depth, as a part of the length", fontsize=8)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=5, fontsize=8, frameon=False)
    figure.tight_layout(rect=(0, 0.04, 1, 1))
    return figure


def _widths(rows: list[dict]):
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 4.2), sharey=True)
    colours = {"random": "#1b6ca8", "aligned": "#6a994e", "one axis": "#d1495b", "nearly": "#e9a23b"}
    markers = {"cylinder": "o", "cone": "^", "ellipsoid": "s"}
    for axis, side in zip(axes, ("gap", "depth")):
        for r in rows:
            if r[f"{side}_width"]:
                axis.scatter(
                    float(r["us"]),
                    float(r[f"{side}_width"]),
                    color=colours[r["poses"]],
                    marker=markers[r["a"]],
                    s=26,
                    lw=0,
                    alpha=0.85,
                )
        axis.set_xscale("log")
        axis.set_yscale("log", base=2)
        axis.grid(alpha=0.25)
        axis.set_title(f"largest bracket of a {side}, in units of S", fontsize=9)
        axis.set_xlabel("µs a pair (all poses of the kind)", fontsize=8)
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], marker="o", ls="", color=c, label=f"poses: {p}") for p, c in colours.items()]
    handles += [Line2D([], [], marker=m, ls="", color="grey", label=a) for a, m in markers.items()]
    figure.legend(handles=handles, loc="lower center", ncols=7, fontsize=8, frameon=False)
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    return figure
