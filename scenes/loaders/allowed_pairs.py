"""Allowed collisions from files, for any World: the disabled pairs of an SRDF, or MoveIt's matrix."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from collide.base import argument_checks as checks
from collide.base.given_files import starts_like_xml
from collide.errors import SceneError, brief, listing
from collide.scenes.loaders.documents import read_document
from collide.scenes.loaders.fields import Fields
from collide.scenes.loaders.moveit import ALLOWED, matrix_pairs
from collide.scenes.loaders.srdf import read_srdf
from collide.worlds.world import World


def read_allowed_pairs(path: str | Path, names: Iterable[str], *, prefix: str = "") -> list[tuple[str, str, str]]:
    """Pairs that a file says need no test.

    Parameters
    ----------
    path : str or Path
        An SRDF; a MoveIt planning scene; or an AllowedCollisionMatrix alone, YAML or JSON, as ROS prints it.
    names : iterable of str
        Of the bodies there are; what the file says about others is left out.
    prefix : str
        That the bodies carry before the names of the file, such as ``"left_"``.

    Returns
    -------
    list of (str, str, str)
        Body, body, reason.

    Raises
    ------
    SceneError
        Naming file and element of what cannot be read, and where the file names none of the bodies.
    """
    path, bodies = checks.file_path("allowed pairs: path", path, SceneError), list(names)
    checks.text("allowed pairs: prefix", prefix)
    known = {name.removeprefix(prefix): name for name in bodies if name.startswith(prefix)}
    if starts_like_xml(path):
        pairs = read_srdf(path, list(known), []).pairs
        named = {link for a, b, _ in pairs for link in (a, b)}
    else:
        matrix = _matrix_of(path)
        pairs = [(a, b, ALLOWED) for a, b in matrix_pairs(matrix, list(known))]
        named = {*matrix.words("entry_names"), *matrix.words("default_entry_names")} & known.keys()
    if not named:
        hint = f" under the prefix {brief(prefix)}" if prefix else ""
        raise SceneError(
            f"names none of the bodies{hint}: {listing(bodies) or 'there are none'}; is it of another robot?", path=path
        )
    return [(known[a], known[b], reason) for a, b, reason in pairs if a != b]


def _matrix_of(path: Path) -> Fields:
    document = read_document(path)
    fields = Fields(document, path)
    if "entry_names" in fields:
        return fields
    if "allowed_collision_matrix" not in fields:
        fields.fail(
            "holds no allowed_collision_matrix and no entry_names: give an SRDF, a planning scene, or a matrix"
        )
    return fields.sub("allowed_collision_matrix", ())


def allow_pairs(world: World, path: str | Path, *, prefix: str = "") -> list[tuple[str, str, str]]:
    """Allow in a World what an SRDF or a MoveIt matrix allows, by the names of its bodies.

    Parameters
    ----------
    world : World
        `World.allow` is called for every pair.
    path : str or Path
        An SRDF; a MoveIt planning scene; or an AllowedCollisionMatrix alone, YAML or JSON.
    prefix : str
        That the bodies carry before the names of the file.

    Returns
    -------
    list of (str, str, str)
        Body, body, reason, as they were allowed.

    Raises
    ------
    SceneError
        Naming file and element of what cannot be read, and where the file names none of the bodies.
    """
    checks.instance("allow_pairs: world", world, World, "a collide.World")
    pairs = read_allowed_pairs(path, world.names.values(), prefix=prefix)
    for a, b, reason in pairs:
        world.allow(a, b, reason=reason)
    return pairs
