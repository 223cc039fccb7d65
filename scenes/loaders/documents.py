"""YAML and JSON text as plain data: safe, bounded, repeated keys refused, places named.

What is handed on is at most `files.DEEPEST` lists and mappings deep, so that whoever walks it may recurse, and what
YAML's aliases repeat is counted before anything is built, so that a walk ends.
"""

from __future__ import annotations

import json
import re
from functools import lru_cache
from pathlib import Path
from typing import Any

from collide.base.given_files import read_text
from collide.errors import MissingExtra, SceneError, brief
from collide.scenes.loaders.files import DEEPEST, MAX_REPEATED

#: A double has 309 digits before the point; Python refuses to read integers of more than 4,300.
_MAX_DIGITS = 400


def read_document(path: Path) -> Any:
    """A YAML or JSON file as plain data. JSON, by its suffix or first character, needs no PyYAML."""
    return parse_document(read_text(path), path)


def parse_document(text: str, path: Path) -> Any:
    """The plain data of YAML or JSON text; the path tells which, and stands in complaints."""
    if path.suffix.lower() == ".json" or text.lstrip()[:1] in ("{", "["):
        try:
            return read_json(text, path)
        except _NotJson:
            if path.suffix.lower() == ".json":
                raise
            # Flow-style YAML starts with a brace too.
    return _read_yaml(text, path)


class _NotJson(SceneError):
    """Text whose syntax is not that of JSON."""


class _Refused(ValueError):
    """JSON that says what is not taken: a key twice, a number of too many digits."""


def read_json(text: str | bytes, path: Path, what: str = "JSON") -> Any:
    """JSON as plain data; SceneError for what is not JSON, is too deep, or says one thing twice."""
    try:
        data = json.loads(text, object_pairs_hook=_without_repeats, parse_int=_integer)
    except _Refused as error:
        raise SceneError(str(error), path=path) from None
    except RecursionError:
        raise SceneError(_too_deep(), path=path) from None
    except ValueError as error:  # not JSON, or bytes that are no text
        raise _NotJson(f"is not {what}: {error}", path=path) from None
    _check_depth(data, path)
    return data


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    mapping = dict(pairs)
    if len(mapping) != len(pairs):
        seen: set[str] = set()
        repeated = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise _Refused(f"the key {brief(repeated)} stands twice in one mapping")
    return mapping


def _integer(text: str) -> int:
    if len(text) > _MAX_DIGITS:
        raise _Refused(f"the integer {text[:20]}... has {len(text)} digits: numbers here are below 1.8e308")
    return int(text)


def _check_depth(data: Any, path: Path) -> None:
    """Refuse lists and mappings too deep in one another, without recursing."""
    level, depth = [data], 0
    while level := [item for item in level if type(item) in (list, dict)]:
        depth += 1
        if depth > DEEPEST:
            raise SceneError(_too_deep(), path=path)
        level = [entry for item in level for entry in (item.values() if type(item) is dict else item)]


def _too_deep(place: str = "") -> str:
    return f"{place}lists and mappings stand more than {DEEPEST} deep in one another: nest less"


# --- YAML -----------------------------------------------------------------------------------------


def _read_yaml(text: str, path: Path) -> Any:
    try:
        import yaml
    except ImportError:
        raise MissingExtra("pyyaml", extra="robots", purpose=f"read {path.name} (JSON needs nothing)") from None
    loader = _yaml_loader()
    try:
        _check_events(yaml.parse(text, Loader=loader), path)
        return yaml.load(text, Loader=loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        what = getattr(error, "problem", None) or error
        raise SceneError(f"is not YAML: {_place(mark)}{what}", path=path) from None
    except (ValueError, TypeError) as error:  # tags that do not fit what they stand at, such as !!set [1]
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"is not YAML: a tag does not fit what stands there ({error})", path=path) from None


def _place(mark) -> str:
    return f"line {mark.line + 1}, column {mark.column + 1}: " if mark is not None else ""


def _check_events(events, path: Path) -> None:
    """Refuse what would not end or crash: PyYAML's C code recurses, and aliases multiply.

    The nodes that an anchor stands for, its own aliases among them, are counted where it ends; an alias repeats them.
    """
    import yaml

    sizes: dict[str | None, int] = {}  # of anchored nodes that have ended
    opened: list[tuple[str | None, int]] = []  # anchor of a list or mapping, and the nodes before it
    nodes = repeated = 0
    for event in events:
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in sizes and any(anchor == event.anchor for anchor, _ in opened):
                raise SceneError(
                    f"{_place(event.start_mark)}the alias *{event.anchor} stands inside what it repeats", path=path
                )
            again = sizes.get(event.anchor, 1)  # an alias of nothing is refused when the file is read
            nodes, repeated = nodes + again, repeated + again
            if repeated > MAX_REPEATED:
                raise SceneError(
                    f"{_place(event.start_mark)}aliases repeat more than {MAX_REPEATED:,} nodes: write the file "
                    "without them",
                    path=path,
                )
        elif isinstance(event, yaml.CollectionStartEvent):
            sizes.pop(event.anchor, None)  # an anchor may be given again
            opened.append((event.anchor, nodes))
            nodes += 1
            if len(opened) > DEEPEST:
                raise SceneError(_too_deep(_place(event.start_mark)), path=path)
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = opened.pop()
            if anchor is not None:
                sizes[anchor] = nodes - before
        elif isinstance(event, yaml.ScalarEvent):
            nodes += 1
            if event.anchor is not None:
                sizes[event.anchor] = 1


@lru_cache(maxsize=1)
def _yaml_loader():
    """PyYAML's safe loader, in C where it can be, with three repairs.

    Repeated keys are refused instead of the last one winning. Numbers such as ``1e-3`` are numbers: YAML 1.1, which
    PyYAML reads, wants a dot in them and would give text. And what looks like a number or a date and is none (an
    integer of 5,000 digits, the 99th of a month) is refused with its place.
    """
    import yaml

    base = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

    class Loader(base):  # type: ignore[misc, valid-type]
        def construct_mapping(self, node, deep=False):
            seen = set()
            for key_node, _ in node.value:
                if isinstance(key_node, yaml.ScalarNode) and key_node.tag != "tag:yaml.org,2002:merge":
                    if key_node.value in seen:
                        problem = f"the key {brief(key_node.value)} stands twice in one mapping"
                        raise yaml.constructor.ConstructorError(None, None, problem, key_node.start_mark)
                    seen.add(key_node.value)
            return super().construct_mapping(node, deep)

        def construct_object(self, node, deep=False):
            try:
                return super().construct_object(node, deep)
            except (ValueError, OverflowError, TypeError, KeyError, AttributeError, IndexError):
                kind = node.tag.rsplit(":", 1)[-1]
                problem = (
                    f"{brief(node.value) if isinstance(node, yaml.ScalarNode) else 'what stands here'} cannot "
                    f"be read as {kind}"
                )
                raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark) from None

    # No two ways to read the same digits: a megabyte of them must not be tried in every way.
    number = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)[eE][-+]?\d+$")
    Loader.add_implicit_resolver("tag:yaml.org,2002:float", number, list("-+.0123456789"))
    return Loader
