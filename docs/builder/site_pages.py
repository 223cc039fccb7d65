"""Pages that are made when the site is built: the public names, room by room, the folders that pages link to, a report.

They are written to ``docs/_site/`` (which git ignores) before Sphinx looks for sources, and only where they are new, so
that a second build reads what changed.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import re
from pathlib import Path

import collide
import collide.scenes
from collide.pages.page_file import page_pieces, write_page
from collide.pages.report_page import report_blocks
from collide.reports import report
from collide.reports.state_reports import Stated

MADE = Path("docs/_site")
#: The page of a report in the site, and where docs/gallery.md has it.
REPORT = MADE / "extra" / "report.html"
FRAME = "<!-- page of a report -->"
LINK = re.compile(r"(\]\()([^)#\s]+)(#[^)\s]*)?(\))")
#: Rooms whose public names stand on one page: page → (title, rooms). Any other room has a page under its own name.
PAGES = {
    "shapes": ("Shapes", ("shapes",)),
    "pairs": ("Pairs of bodies", ("pairs", "results", "transforms")),
    "worlds": ("Worlds", ("worlds",)),
    "hierarchies": ("Hierarchies and the walk", ("papers.hierarchies",)),
    "errors": ("Errors, and where the C interface is", ("errors", "kernels")),
}
#: In this order; rooms that are not named come after them.
ORDER = ("shapes", "pairs", "worlds", "contact", "casts", "motion", "robots", "sweeps", "surface_queries", "tetrahedra")
#: Public modules beside `collide` and `collide.scenes`: page → (title, modules).
MODULES = {
    "live": ("Looking at a World", ("collide.adapters.live.world_viewer",)),
    "viewers": (
        "Viewers of others",
        tuple(f"collide.adapters.viewers.{name}" for name in ("viser_view", "rerun_log", "foxglove_log")),
    ),
    "reports": ("Reports", ("collide.reports.report", "collide.reports.classes")),
    "peers": (
        "Other engines, asked the same",
        tuple(f"collide.adapters.peers.{name}" for name in ("compare", "exact", "protocol", "question", "stress")),
    ),
    "planners": ("Planners with our proofs", ("collide.adapters.planning.ompl",)),
    "hosts": (
        "Programs written for other engines",
        tuple(
            f"collide.adapters.hosts.{name}"
            for name in ("mujoco", "fcl_api", "coal_api", "pinocchio", "pybullet_mirror", "newton")
        ),
    ),
}


def write_pages(root: Path) -> None:
    """Write what is made; pages of an earlier build that are made no more go away."""
    made = {**_of_names(), **_of_folders(root)}
    made[MADE / "api" / "index.rst"] = _index(made)
    for path, text in made.items():
        place = root / path
        place.parent.mkdir(parents=True, exist_ok=True)
        if not place.exists() or place.read_text(encoding="utf-8") != text:
            place.write_text(text, encoding="utf-8")
    for old in (root / MADE).rglob("*.rst"):
        if old.relative_to(root) not in made:
            old.unlink()
    _write_report(root / REPORT)


def _write_report(place: Path) -> None:
    """The page of the shipped work cell: numpy is enough to make it."""
    scene = collide.scenes.load("workcell")
    made = [Stated("", scene, report.make(scene, clearance=0.02))]
    place.parent.mkdir(parents=True, exist_ok=True)
    write_page(page_pieces("collide report: workcell", report_blocks(made, {})), str(place))


# --- public names -------------------------------------------------------------------------------


def public_names() -> dict[str, list[str]]:
    """Room → the public names of `collide` that live there, as they are imported."""
    by_room: dict[str, list[str]] = {}
    for name in collide.__all__:
        own = getattr(collide, name).__module__.removeprefix("collide.")
        home = own.rpartition(".")[0] or own
        by_room.setdefault(home, []).append(name)
    return by_room


def _of_names() -> dict[Path, str]:
    rooms = public_names()
    pages: dict[Path, str] = {}
    for page, (title, homes) in PAGES.items():
        names = [name for home in homes for name in rooms.pop(home, [])]
        pages[_api(page)] = _page(title, "", [_directive("collide", name) for name in names])
    for home, names in rooms.items():
        about = inspect.getdoc(importlib.import_module(f"collide.{home}")) or home
        title, *rest = about.split("\n\n")[0].replace("\n", " ").split(": ", 1)
        text = ": ".join([title, *rest]) if rest else ""
        blocks = [_directive("collide", name) for name in names]
        pages[_api(home.rpartition(".")[2])] = _page(title.rstrip("."), text, blocks)
    named = [_directive("collide.scenes", name) for name in collide.scenes.__all__]
    pages[_api("scenes")] = _page("Scenes", "", named)
    for page, (title, modules) in MODULES.items():
        blocks = [text for module in modules for text in _of_module(module)]
        pages[_api(page)] = _page(title, "", blocks)
    return pages


def _api(page: str) -> Path:
    return MADE / "api" / f"{page}.rst"


def _of_module(name: str) -> list[str]:
    """The functions and classes that a module makes itself and that have docstrings, under the module's summary."""
    module = importlib.import_module(name)
    names = [
        key
        for key, value in vars(module).items()
        if not key.startswith("_")
        and (inspect.isclass(value) or inspect.isroutine(value))
        and value.__module__ == name
        and inspect.getdoc(value)
    ]
    return [f"{name}\n{'-' * len(name)}\n\n.. automodule:: {name}\n", *(_directive(name, key) for key in names)]


def _directive(module: str, name: str) -> str:
    value = getattr(importlib.import_module(module), name)
    if not inspect.isclass(value):
        return f".. autofunction:: {module}.{name}\n"
    # fields of plain rows are told in the docstring of their class: a second list of them would say nothing
    fields = [key for key in getattr(value, "__annotations__", {}) if not key.startswith("_")]
    hidden = f"   :exclude-members: {', '.join(fields)}\n" if fields else ""
    return f".. autoclass:: {module}.{name}\n   :members:\n{hidden}"


def _page(title: str, text: str, blocks: list[str]) -> str:
    return "\n".join([title, "=" * len(title) * 2, "", text, "", *blocks])


def _index(made: dict[Path, str]) -> str:
    pages = [path.stem for path in made if path.parent.name == "api"]
    pages.sort(key=lambda page: (ORDER.index(page) if page in ORDER else len(ORDER), page))
    lines = ["Public names", "============", "", "By room of the house; their docstrings are what ``help`` shows.", ""]
    return "\n".join([*lines, ".. toctree::", "   :maxdepth: 1", "", *(f"   {page}" for page in pages), ""])


# --- folders --------------------------------------------------------------------------------------


def linked_folders(root: Path) -> list[Path]:
    """Folders of the repository that pages link to, sorted."""
    linked: set[Path] = set()
    for page in (*root.glob("*.md"), *(root / "docs").glob("*.md"), root / "benchmarks" / "README.md"):
        for _, target, _, _ in LINK.findall(page.read_text(encoding="utf-8")):
            place = Path(os.path.normpath(page.parent / target))
            if "://" not in target and place.is_dir():
                linked.add(place.relative_to(root))
    return sorted(linked)


def folder_page(folder: Path) -> Path:
    return MADE / "folders" / ("-".join(folder.parts) + ".rst")


def _of_folders(root: Path) -> dict[Path, str]:
    return {folder_page(folder): _folder(root, folder) for folder in linked_folders(root)}


def _folder(root: Path, folder: Path) -> str:
    title = f"{folder.as_posix()}/"
    lines = [":orphan:", "", title, "=" * len(title), ""]
    for file in sorted((root / folder).iterdir()):
        if file.suffix in (".py", ".c", ".h", ".cpp", ".md", ".yaml", ".json") and file.name != "built.py":
            above = os.path.relpath(root / folder / file.name, root / folder_page(folder).parent)
            lines += [f":download:`{file.name} <{Path(above).as_posix()}>`", f"    {_first_line(file)}", ""]
    return "\n".join(lines)


def _first_line(file: Path) -> str:
    """What a file says of itself first, as code so that no word of it is taken for markup."""
    if file.suffix != ".py":
        return "\\ "
    text = (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").split("\n")[0].replace("`", "'")
    return re.sub(r"([*|\\])|(?<=\w)(_)(?!\w)", r"\\\g<0>", text) or "\\ "


#: The report in the middle of a page, and alone.
_FRAMED = """
```{raw} html
<p>The same page, not as a picture: turn it, click a row. <a href="../report.html">Alone</a></p>
<iframe src="../report.html" title="The report of the work cell as a page" loading="lazy"
 style="width: 100%; height: 36rem; border: 1px solid"></iframe>
```
"""


# --- links ----------------------------------------------------------------------------------------


class Links:
    """Links as the site has them: folders lead to their pages, and the first page holds the tree of all."""

    def __init__(self, root: Path):
        self._root = root

    def rewrite(self, app, docname: str, source: list[str]) -> None:
        """Sphinx's event: ``source`` holds the text of a page, and is changed in place."""
        page = self._root / f"{docname}.md"
        if not page.exists():
            return
        source[0] = LINK.sub(lambda match: self._link(page, match), source[0]).replace(FRAME, _FRAMED)
        if docname == app.config.root_doc:
            source[0] += self._tree()

    def _link(self, page: Path, match: re.Match) -> str:
        target = match.group(2)
        place = Path(os.path.normpath(page.parent / target))
        if "://" in target or not place.is_dir():
            return match.group(0)
        made = os.path.relpath(self._root / folder_page(place.relative_to(self._root)), page.parent)
        return f"{match.group(1)}{Path(made).as_posix()}{match.group(4)}"

    def _tree(self) -> str:
        """The pages that docs/index.md lists, in its order, under its headings."""
        index = (self._root / "docs" / "index.md").read_text(encoding="utf-8")
        trees = [("Index", ["docs/index"])]
        for caption, rows in re.findall(r"^## (.+)\n((?:.|\n(?!## ))*)", index, flags=re.MULTILINE):
            targets = re.findall(r"^\| \[[^\]]+\]\(([^)]+)\) \|", rows, flags=re.MULTILINE)
            pages = [os.path.normpath(f"docs/{target}").replace(os.sep, "/") for target in targets]
            trees.append((caption, [page.removesuffix(".md") for page in pages]))
        trees[-1][1].append("benchmarks/README")
        trees.append(("Reference", [(MADE / "api" / "index").as_posix()]))
        return "".join(
            f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n" + "\n".join(pages) + "\n```\n"
            for caption, pages in trees
        )
