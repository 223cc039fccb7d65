"""The error tree. Every message names the argument, its value, and what to do about the error.

    CollideError
    ├── InvalidShape      a shape was made from numbers that describe no shape
    ├── InvalidPose       a pose is not a finite rotation and translation
    ├── InvalidArgument   a query or a World was given an argument outside its contract
    ├── UnknownBody       a name or id of no body in the World
    ├── UnsupportedQuery  the question has no finite answer, or no method for this pair of shapes
    ├── SceneError        the file of a scene, a robot or a mesh is missing or wrong
    └── MissingExtra      an optional package is needed; the message gives the command to install the package
"""

from __future__ import annotations

import reprlib
from collections.abc import Iterable

#: Characters of a value, of a place in a file and of a whole message that are shown; names may have a megabyte.
LONGEST_VALUE, LONGEST_PLACE, LONGEST_MESSAGE = 80, 240, 4000


def brief(value: object) -> str:
    """A value for a message: numpy's numbers as numbers, cut where it is long, and never written out whole before."""
    if type(value).__module__ == "numpy" and not getattr(value, "shape", True):  # without importing it
        value = value.item()  # type: ignore[attr-defined]
    if isinstance(value, str):
        return repr(value) if len(value) <= LONGEST_VALUE else repr(value[: LONGEST_VALUE - 3]) + "..."
    return cut(_SHORT.repr(value), LONGEST_VALUE)


def cut(text: str, max_length: int = LONGEST_VALUE) -> str:
    """A text with its middle left out where it is longer than ``max_length`` characters."""
    if len(text) <= max_length:
        return text
    head, tail = max_length * 3 // 4 - 2, max_length // 4 - 1
    return f"{text[:head]}...{text[-tail:]}"


def listing(names: Iterable[object], max_names: int = 30) -> str:
    """Names separated by commas, each cut where it is long; of many the first."""
    names = list(names)
    listed = ", ".join(cut(str(name)) for name in names[:max_names])
    return listed if len(names) <= max_names else f"{listed} and {len(names) - max_names} more"


class _Short(reprlib.Repr):
    """`reprlib` with room for a row of a matrix, and for integers that Python does not write out."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxstring, self.maxother = 5, LONGEST_VALUE, LONGEST_VALUE
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = 12

    def repr_int(self, x: int, level: int) -> str:
        return repr(x) if x.bit_length() < 256 else f"an integer of {x.bit_length()} bits"


_SHORT = _Short()


class CollideError(Exception):
    """Base of every error that collide raises on purpose."""


class InvalidShape(CollideError, ValueError):
    """A shape's numbers describe no shape; the message names shape, field and value."""


class InvalidPose(CollideError, ValueError):
    """A pose is not (4, 4), not finite, or too far from a rotation."""


class InvalidArgument(CollideError, ValueError):
    """An argument of a query, a World or a filter has the wrong type, shape or range."""


class UnknownBody(CollideError, LookupError):
    """No body of the World has this name or id."""


class UnsupportedQuery(CollideError):
    """The question has no finite answer for this pair, for example the depth of two half-spaces."""


class SceneError(CollideError, ValueError):
    """A scene, robot or mesh file cannot be used.

    Parameters
    ----------
    what : the complaint, with the offending value and the remedy.
    path : the file it stands in.
    element : the part of the file, in the file's own words (``link "forearm"``, ``bodies[3].pose``).
    """

    def __init__(self, what: str, *, path: object = None, element: str | None = None):
        self.what, self.path = cut(what, LONGEST_MESSAGE), path
        self.element = None if element is None else cut(element, LONGEST_PLACE)
        place = ": ".join(str(p) for p in (path, self.element) if p is not None)
        super().__init__(f"{place}: {self.what}" if place else self.what)
        #: Of an error that stands for several: the message of each.
        self.messages: tuple[str, ...] = ()

    @classmethod
    def of_several(cls, messages: Iterable[str]) -> SceneError:
        """A single error with the complaints of several.

        Parameters
        ----------
        messages : iterable of str
            The message of each, two or more.

        Returns
        -------
        SceneError
            With all of them in its text and in ``messages``.
        """
        messages = [*messages]
        made = cls(f"{len(messages)} complaints: " + "; ".join(messages))
        made.messages = tuple(messages)
        return made


class MissingExtra(CollideError, ImportError):
    """An optional package is not installed.

    Parameters
    ----------
    package : what could not be imported, by its name on the package index.
    extra : the extra of ``collide-robotics`` with the package.
    purpose : what the package is needed for, completing the words "is needed to ...".
    """

    def __init__(self, package: str, *, extra: str, purpose: str):
        self.package, self.extra = package, extra
        super().__init__(
            f"{package} is needed to {purpose}: pip install 'collide-robotics[{extra}]'"
        )
