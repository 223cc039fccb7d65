"""The one error tree. Every message names the thing, the value, and what to do about it.

    CollideError
    ├── InvalidShape      a shape was made from numbers that describe none
    ├── InvalidPose       a pose is not a finite rotation and translation
    ├── InvalidArgument   a query or a World was asked with an argument it cannot use
    ├── UnknownBody       a name or id that no body of the World has
    ├── UnsupportedQuery  the question has no finite answer, or this pair of shapes cannot answer it
    ├── SceneError        a file that describes a scene, a robot or a mesh is missing or wrong
    └── MissingExtra      an optional package is needed; the message gives the command that installs it
"""

from __future__ import annotations


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
        self.what, self.path, self.element = what, path, element
        place = ": ".join(str(p) for p in (path, element) if p is not None)
        super().__init__(f"{place}: {what}" if place else what)


class MissingExtra(CollideError, ImportError):
    """An optional package is not installed.

    Parameters
    ----------
    package : what could not be imported, by its name on the package index.
    extra : the extra of ``collide-robotics`` that brings it.
    purpose : what it is needed for, completing the words "is needed to ...".
    """

    def __init__(self, package: str, *, extra: str, purpose: str):
        self.package, self.extra = package, extra
        super().__init__(
            f"{package} is needed to {purpose}: pip install 'collide-robotics[{extra}]'"
        )
