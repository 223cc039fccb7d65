"""xacro: robots with macros, expanded by the package of that name, arguments at their defaults."""

from __future__ import annotations

from pathlib import Path

from collide.base.given_files import read_bytes
from collide.errors import MissingExtra, SceneError, brief


def expanded(path: Path) -> bytes:
    """The XML that a xacro file stands for.

    Raises MissingExtra without xacro; SceneError for what it cannot expand, such as ``$(find NAME)`` outside of ROS.
    """
    read_bytes(path)  # size and kind of the file are checked there
    try:
        import xacro
    except ImportError:
        raise MissingExtra("xacro", extra="xacro", purpose=f"expand {path.name}") from None
    try:
        return xacro.process_file(str(path)).toxml(encoding="utf-8")
    except Exception as error:  # noqa: BLE001 - any class, of macros that Python evaluates
        advice = ""
        if "ament" in str(error) or "rospkg" in str(error) or "find" in str(error):
            advice = "; $(find NAME) needs the environment of ROS: expand it there (xacro in.xacro > out.urdf)"
        what = f"xacro cannot expand it: {type(error).__name__}: {brief(str(error))}{advice}"
        raise SceneError(what, path=path) from None
