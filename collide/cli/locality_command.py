"""The command locality: how local meshes are, and one made local, written to a file."""

from __future__ import annotations

from typing import Any

from collide.cli.files import MESH_SUFFIXES, write_json
from collide.errors import InvalidArgument

EPILOG = """examples:
  collide locality bunny.ply
  collide locality teapot.ply dragon.ply.gz --plot stretches.png
  collide locality part.stl --json - | jq '.meshes[].local_stretch'
  collide locality part.stl --localised local.obj --stretch 10

How fast meshes can be tested for collision is bounded by how local they are
(Erickson, "Local polyhedra and geometric graphs", 2003):
  global stretch   longest edge over shortest
  local stretch    longest edge at a vertex, over the distance to its nearest
                   other vertex; of order k: to its k-th nearest
Each is given for its worst vertex, and as a distribution: one bad vertex does
not slow a mesh down, long edges packed closely together do. --plot draws how
many vertices have which stretch: pip install 'collide-robotics[plots]' first.
The last table is about the trees: the one that queries walk, and the graded
box-tree that the paper's bounds are proven for, its outliers and its bounds.
docs/locality.md explains the numbers and what to do about large ones.

--localised cuts one mesh until no local stretch is larger than --stretch and
writes it; tables then show it before and after.

Vertices with equal coordinates are one vertex. Vertices that no facet uses
count as neighbours.

exit status: 0 measured, 2 error"""


def add_arguments(parser) -> None:
    """Those of its own."""
    parser.add_argument(
        "meshes", nargs="+", metavar="MESH", help="a mesh file: PLY, STL, OBJ, OFF, 3MF, DAE, GLB, glTF; .gz too"
    )
    parser.add_argument("--plot", metavar="FILE", help="draw the distributions: a .png, .svg or .pdf file")
    parser.add_argument("--repeated", action="store_true",
                        help="count vertices with equal coordinates one by one, as Table 1 of the paper does")
    parser.add_argument("--localised", metavar="FILE",
                        help="make the mesh local, and write it: .stl, .ply, .obj, .off, .3mf, .glb")
    parser.add_argument("--stretch", type=float, default=10.0, metavar="S",
                        help="with --localised: the largest local stretch, 3.2 or more (10)")
    parser.add_argument("--order", type=int, default=1, metavar="K",
                        help="with --localised: of this order, 1 to 10 (1)")
    parser.add_argument("--max-facets", type=int, default=200_000, metavar="N",
                        help="with --localised: refuse what takes more (200000)")


def run(args, progress) -> int:
    """Measure, and make local where asked to; 0."""
    from collide.papers.hierarchies.tree_figures import tree_figures
    from collide.reports import locality_report, terminal
    from collide.scenes.loaders.triangles import read_meshes

    if args.plot:
        locality_report.check_plot(args.plot)
    if args.localised and not args.localised.lower().endswith(MESH_SUFFIXES):
        raise InvalidArgument(f"--localised: {args.localised!r} must end in {', '.join(MESH_SUFFIXES)}")
    meshes = []
    for place in args.meshes:
        with progress(f"reading {place}"):
            meshes += [(name, place, mesh) for name, mesh in read_meshes(place)]
    if args.localised:
        meshes.append(_localised(meshes, args, progress))
    measured = []
    for name, place, mesh in meshes:

        def about(label: str, name=name):
            return progress(f"{name}: {label}")

        measures = mesh.locality(repeated=args.repeated, progress=about)
        with progress(f"{name}: building trees"):
            measured.append(locality_report.Measured(name, place, measures, tree_figures(mesh)))
    if args.plot:
        with progress("drawing"):
            locality_report.plot(measured, args.plot)
    if args.json:
        write_json(locality_report.to_dict(measured, args.repeated).items(), args.json)
    if args.json != "-" and not args.quiet:
        for k, table in enumerate(locality_report.tables(measured)):
            terminal.write_text("\n" if k else "")
            terminal.show_table(table)
    return 0


def _localised(meshes: list, args, progress) -> tuple[str, str, Any]:
    """(name, place, mesh), once it is written."""
    if len(meshes) != 1:
        raise InvalidArgument(f"--localised: takes one mesh at a time, got {len(meshes)}: name one file with one mesh")
    name, _, mesh = meshes[0]

    def about(label: str):
        return progress(f"{name}: {label}")

    made = mesh.localised(args.stretch, args.order, max_facets=args.max_facets, progress=about).mesh
    made.save(args.localised)
    return f"{name}, localised", args.localised, made
