"""How local meshes are, as tables, JSON and a plot; reads what `Mesh.locality` measured.

The plot draws the distributions as figure 13 of Erickson's "Local polyhedra and geometric graphs" does:
how many vertices have which stretch, of the first order and of the tenth.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from collide.base.whole_file import whole_file
from collide.errors import InvalidArgument, MissingExtra
from collide.reports.tables import Column, Table

SCHEMA = "collide-locality/1"
#: Orders that Table 1 of the paper prints; JSON has all ten.
_PRINTED = (1, 2, 3, 4, 6, 8, 10)
_SHARES = (0.5, 0.9, 0.99, 0.999)
_ABOUT = [
    "Σ: longest edge over shortest. σ: longest edge at a vertex over the distance to its nearest other vertex.",
    "σk: the same to its k-th nearest; each is the largest over all vertices. A mesh is local where these are small.",
    "depth: at most so many levels in a graded box-tree of a connected mesh, ⌈log2 nΣ⌉.",
]
_TREES = [
    "nodes of the graded tree: at most 2F - 1. level: of its octree, at most log2(W/l) + 3 (W width, l shortest edge).",
    "outliers: facets that fit into no child of their node.",
]


class Measured(NamedTuple):
    """A measured mesh: its name, its file, its `Locality`, and the `TreeFigures` of the trees over its facets."""

    name: str
    path: str
    locality: Any
    trees: Any


def to_dict(measured: list[Measured], repeated: bool) -> dict:
    """Plain data for JSON: everything but the single vertices. repeated : how equal vertices were counted."""
    return {"schema": SCHEMA, "repeated": repeated, "meshes": [_mesh_dict(item) for item in measured]}


def _mesh_dict(item: Measured) -> dict:
    locality = item.locality
    limits, counts = locality.histogram()
    return {
        "name": item.name, "path": item.path, "vertices": locality.vertices, "distinct": locality.distinct,
        "in_use": locality.in_use, "facets": locality.facets, "shortest_edge": locality.shortest,
        "longest_edge": locality.longest,
        "global_stretch": locality.global_stretch, "local_stretch": locality.local_stretches.tolist(),
        "worst_vertex": locality.worst.tolist(), "mean": locality.means.tolist(),
        "quantiles": {str(share): row.tolist() for share, row in zip(_SHARES, locality.quantiles(_SHARES))},
        "histogram": {"limits": limits.tolist(), "counts": counts.T.tolist()}, "depth_bound": locality.depth_bound,
        "trees": {**item.trees._asdict(), "node_bound": item.trees.node_bound},
    }


def tables(measured: list[Measured]) -> list[Table]:
    """Table 1 of the paper for these meshes, and how the stretches are distributed."""
    head = [Column("mesh", "name"), Column("n"), Column("Σ")]
    head += [Column("σ" if k == 1 else f"σ{k}", optional=0 if k in (1, 10) else k) for k in _PRINTED]
    head.append(Column("depth", optional=11))
    rows = [
        [item.name, str(item.locality.distinct), _figure(item.locality.global_stretch)]
        + [_figure(item.locality.local_stretches[k - 1]) for k in _PRINTED]
        + [str(item.locality.depth_bound)]
        for item in measured
    ]
    return [Table("LOCALITY", head, rows, notes=_ABOUT), _distribution(measured), _trees(measured)]


def _trees(measured: list[Measured]) -> Table:
    columns = [
        Column("mesh", "name"), Column("facets"), Column("nodes", optional=2), Column("depth"),
        Column("graded nodes", optional=1),
        Column("at most", optional=1), Column("graded depth"), Column("level"), Column("at most"), Column("outliers"),
        Column("at one node", optional=2),
    ]
    rows = []
    for item in measured:
        t = item.trees
        counts = (
            t.facets,
            t.nodes,
            t.depth,
            t.graded_size,
            t.node_bound,
            t.graded_depth,
            t.graded_level,
            t.level_bound,
        )
        rows.append([item.name, *map(str, counts), f"{100 * t.outlier_share:.1f} %", str(t.max_outliers)])
    return Table(
        "TREES  the one that queries walk, eight boxes a node; the graded box-tree of the paper",
        columns,
        rows,
        notes=_TREES,
    )


def _distribution(measured: list[Measured]) -> Table:
    columns = [Column("mesh", "name"), Column("order", "label"), Column("mean")]
    columns += [Column(f"{100 * share:g} %") for share in _SHARES] + [
        Column("largest"),
        Column("at vertex", optional=1),
    ]
    rows = []
    for item in measured:
        quantiles = item.locality.quantiles(_SHARES)
        for k in (1, 10):
            rows.append(
                [item.name, "σ" if k == 1 else f"σ{k}", _figure(item.locality.means[k - 1])]
                + [_figure(row[k - 1]) for row in quantiles]
                + [_figure(item.locality.local_stretches[k - 1]), str(item.locality.worst[k - 1])]
            )
    return Table("DISTRIBUTION  stretches that so many of the vertices do not exceed", columns, rows)


def _figure(value: float) -> str:
    """Five or more digits, and at most three after the point, as the paper prints."""
    return f"{value:.3f}" if value < 1e5 else f"{value:.0f}"


def check_plot(place: str) -> None:
    """Refuse a file that `plot` could not write, before anything is measured."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
    except ImportError:
        raise MissingExtra("matplotlib", extra="plots", purpose="draw distributions") from None
    known = sorted(FigureCanvasAgg.get_supported_filetypes())
    if Path(place).suffix[1:].lower() not in known:
        raise InvalidArgument(f"--plot: {place!r} must end in one of {', '.join('.' + kind for kind in known)}")


def plot(measured: list[Measured], place: str) -> None:
    """Write the distributions of σ and σ_10 to an image file, a panel a mesh. Needs matplotlib."""
    check_plot(place)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 2.6 * len(measured) + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(measured), 1, sharex=True, squeeze=False)[:, 0]
    for panel, item in zip(panels, measured):
        _draw(panel, item)
    panels[-1].set_xlabel("local stretch")
    with whole_file(place) as file:
        figure.savefig(file, dpi=150, format=Path(place).suffix[1:].lower())


def _draw(panel, item: Measured) -> None:
    limits, counts = item.locality.histogram(bins_an_octave=8)
    for k, colour in ((1, "tab:blue"), (10, "tab:orange")):
        largest = item.locality.local_stretches[k - 1]
        label = f"σ, at most {_figure(largest)}" if k == 1 else f"σ{k}, at most {_figure(largest)}"
        panel.stairs(counts[:, k - 1], limits, color=colour, fill=True, alpha=0.35, label=label)
        panel.axvline(largest, color=colour, linewidth=0.8, linestyle=":")
    panel.set_xscale("log")
    panel.set_yscale("symlog", linthresh=1.0)
    panel.set_ylim(bottom=0.0)
    panel.set_ylabel("vertices")
    panel.set_title(
        f"{item.name}: {item.locality.distinct} vertices, Σ = {_figure(item.locality.global_stretch)}", fontsize=10
    )
    panel.legend(fontsize=8)
