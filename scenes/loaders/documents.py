"""YAML and JSON text as plain data: safe, repeated keys refused, places named."""

from __future__ import annotations

import json
import re
from functools import lru_cache
from pathlib import Path
from typing import Any

from collide.errors import MissingExtra, SceneError

#: Larger text is refused before it is parsed; a scene description is far below.
LARGEST_TEXT = 256 * 2**20


def read_bytes(path: Path) -> bytes:
    """The bytes of a file; SceneError where it is missing, a folder, or too large."""
    try:
        if path.is_dir():
            raise SceneError("is a folder; name a file in it", path=path)
        if path.stat().st_size > LARGEST_TEXT:
            raise SceneError(f"is larger than {LARGEST_TEXT >> 20} MiB: not a description", path=path)
        return path.read_bytes()
    except FileNotFoundError:
        raise SceneError("no such file", path=path) from None
    except OSError as error:
        raise SceneError(f"cannot be read: {error.strerror or error}", path=path) from None


def read_text(path: Path) -> str:
    """A file as UTF-8 text."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(f"is not UTF-8 text (byte {error.start})", path=path) from None


def read_document(path: Path) -> Any:
    """A YAML or JSON file as plain data. JSON, by its suffix or first character, needs no PyYAML."""
    text = read_text(path)
    if path.suffix.lower() == ".json" or text.lstrip()[:1] in ("{", "["):
        try:
            return json.loads(text, object_pairs_hook=_without_repeats)
        except _Repeated as error:
            raise SceneError(f"the key {error.args[0]!r} stands twice in one mapping", path=path) from None
        except (json.JSONDecodeError, RecursionError) as error:
            if path.suffix.lower() == ".json":
                raise SceneError(f"is not JSON: {error}", path=path) from None
            # Flow-style YAML starts with a brace too.
    return _read_yaml(text, path)


class _Repeated(ValueError):
    """A key that stands twice in one mapping."""


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    mapping = dict(pairs)
    if len(mapping) != len(pairs):
        keys = [key for key, _ in pairs]
        raise _Repeated(next(key for key in keys if keys.count(key) > 1))
    return mapping


def _read_yaml(text: str, path: Path) -> Any:
    try:
        import yaml
    except ImportError:
        raise MissingExtra("pyyaml", extra="robots", purpose=f"read {path.name} (JSON needs nothing)") from None
    try:
        return yaml.load(text, Loader=_yaml_loader())
    except (yaml.YAMLError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark is not None else ""
        raise SceneError(f"is not YAML: {place}{getattr(error, 'problem', None) or error}", path=path) from None


@lru_cache(maxsize=1)
def _yaml_loader():
    """PyYAML's safe loader, in C where it can be, with two repairs.

    Repeated keys are refused instead of the last one winning, and numbers such as ``1e-3`` are
    numbers: YAML 1.1, which PyYAML reads, wants a dot in them and would give text.
    """
    import yaml

    base = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

    class Loader(base):  # type: ignore[misc, valid-type]
        def construct_mapping(self, node, deep=False):
            seen = set()
            for key_node, _ in node.value:
                if isinstance(key_node, yaml.ScalarNode) and key_node.tag != "tag:yaml.org,2002:merge":
                    if key_node.value in seen:
                        raise yaml.constructor.ConstructorError(
                            None, None, f"the key {key_node.value!r} stands twice in one mapping", key_node.start_mark
                        )
                    seen.add(key_node.value)
            return super().construct_mapping(node, deep)

    number = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)[eE][-+]?\d+$")
    Loader.add_implicit_resolver("tag:yaml.org,2002:float", number, list("-+.0123456789"))
    return Loader
