"""What pages say is there: files, links, commands, the rooms of the drawing, the places of the glossary."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("collide", "adapters", "scenes")
LIFE = ROOT / "docs" / "life_of_a_query.md"


def _pages() -> list[Path]:
    top = [ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "CHANGELOG")]
    return [*top, *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "benchmarks").glob("*.md"))]


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= 1200


def test_every_page_is_in_the_index():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    missing = [page.name for page in (ROOT / "docs").glob("*.md") if f"]({page.name})" not in index]
    assert missing == ["index.md"], missing


def test_links_between_pages_lead_somewhere():
    for page in _pages():
        for link in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
            if "://" not in link and not link.startswith("mailto:"):
                assert (page.parent / link).exists(), f"{page.name} links to {link}"


def test_links_say_where_they_lead():
    """``[`exact/`](collide/narrowphase/exact)``: what stands there as code is the end of the path."""
    for page in _pages():
        for name, link in re.findall(r"\[`([\w/.-]+)`\]\(([^)#\s]+)\)", page.read_text(encoding="utf-8")):
            if "/" in name or Path(name).suffix in (".py", ".md"):
                assert f"/{link.rstrip('/')}".endswith("/" + name.rstrip("/")), f"{page.name}: {name} leads to {link}"


def test_files_that_pages_name_exist():
    """``examples/01_two_shapes.py``, ``bash tests/run.sh``, ``collide/narrowphase/bounds.py``: as code, so as files."""
    named = re.compile(r"(?:\.ci|adapters|benchmarks|collide|docs|examples|scenes|tests)/[\w./-]*\w")
    for page in _pages():
        for code in re.findall(r"`[^`]+`|```.*?```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
            for path in named.findall(code):
                places = [ROOT / path, *(ROOT / folder / path for folder in FOLDERS)]
                assert any(place.exists() for place in places), f"{page.name} names {path}"


def test_public_names_stand_on_pages():
    import collide

    text = "\n".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("*.md"))
    assert set(collide.__all__) <= set(re.findall(r"\w+", text)), set(collide.__all__) - set(re.findall(r"\w+", text))


def test_commands_that_pages_show_exist():
    from collide.cli.arguments import parser

    (commands,) = (set(action.choices) for action in parser()._actions if action.dest == "command")
    for page in _pages():
        for word in re.findall(r"^(?:\$ )?collide ([a-z]+)\b", page.read_text(encoding="utf-8"), flags=re.MULTILINE):
            assert word in commands, f"{page.name} shows `collide {word}`"


def test_pages_are_listed():
    """docs/index.md leads to every page."""
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    missing = [
        page.name for page in (ROOT / "docs").glob("*.md") if page.name != "index.md" and f"]({page.name})" not in index
    ]
    assert not missing, f"docs/index.md does not list {missing}"


def drawn() -> set[str]:
    """Paths that the drawing of the house names: folders end with a slash."""
    text = (ROOT / "docs" / "house.md").read_text(encoding="utf-8")
    block = re.findall(r"```text\n(.*?)```", text, flags=re.DOTALL)[1]
    paths, parents = set(), [""]
    for line in block.splitlines():
        depth = (len(line) - len(line.lstrip())) // 2
        names = re.split(r"\s{2,}", line.strip())[0].split()
        inner = re.findall(r"\b\w+\.py\b", line)
        del parents[depth + 1 :]
        base = parents[depth]
        for name in {*names, *inner}:
            beside = name in names or not names[0].endswith("/")
            paths.add((base if beside else base + names[0]) + name)
        parents.append(base + names[0])
    return {path for path in paths if path.endswith(("/", ".py"))}


def test_drawing_names_what_exists():
    missing = [path for path in drawn() if "<" not in path and not (ROOT / path).exists()]
    assert not missing, f"docs/house.md draws {missing}"


def test_every_room_is_drawn():
    rooms = {f"{path.relative_to(ROOT).as_posix()}/" for folder in FOLDERS for path in (ROOT / folder).rglob("*/")}
    rooms = {room for room in rooms if "__pycache__" not in room and list((ROOT / room).glob("*.py"))}
    files = {f"collide/{path.name}" for path in (ROOT / "collide").glob("*.py")}
    missing = sorted((rooms | files) - drawn())
    assert not missing, f"docs/house.md lacks {missing}"


def test_places_of_the_glossary_exist():
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    places = re.findall(r"^\| .+ \| .+ \| `([^`]+)` \|$", text, flags=re.MULTILINE)
    assert len(places) >= 100
    missing = [place for place in places if not any((base / place).exists() for base in (ROOT / "collide", ROOT))]
    assert not missing, f"docs/glossary.md: {missing}"


def test_terms_of_the_glossary_stand_once():
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    terms = re.findall(r"^\| ([^|]+) \| [^|]+ \| `", text, flags=re.MULTILINE)
    twice = {term for term in terms if terms.count(term) > 1}
    assert not twice, twice


@pytest.mark.parametrize("claim", re.findall(r"`([\w/]+\.py): (\w+(?:\.\w+)?)`", LIFE.read_text(encoding="utf-8")))
def test_life_of_a_query_names_what_exists(claim):
    """``narrowphase/dispatch.py: method_of``: a file of collide, and a function, class or constant of it."""
    file, name = claim
    path = ROOT / "collide" / file
    assert path.is_file(), f"docs/life_of_a_query.md names {file}"
    tree = ast.parse(path.read_text(encoding="utf-8"))
    known = {node.name for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    known |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    assert set(name.split(".")) <= known, f"docs/life_of_a_query.md: {file} has no {name}"


def test_life_of_a_query_is_followed():
    assert len(re.findall(r"`[\w/]+\.py: \w+", LIFE.read_text(encoding="utf-8"))) >= 20
