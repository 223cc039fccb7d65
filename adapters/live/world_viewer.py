"""Looking at a World while a program changes it: `view` gives a page on this machine that follows it."""

from __future__ import annotations

import atexit
import html
import math
import webbrowser

from collide.adapters.live.event_server import LiveServer
from collide.adapters.live.page_state import Limits, WorldState
from collide.adapters.live.scene_of_world import SceneOfWorld, scene_of_world
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief
from collide.worlds.world import World


def view(
    world: World, *, clearance: float = 0.0, min_depth: float = 0.0, title: str = "World", port: int = 0,
    rate: float = 30.0, browser: bool = False,
) -> WorldViewer:
    """Look at a World: the page of a report, in a browser on this machine, that follows it.

        viewer = collide.adapters.view(world, clearance=0.02)
        for t in times:
            world.set_poses(ids, poses(t))
            viewer.update(f"t = {t:.2f} s")

    In a notebook the viewer, as the last line of a cell, is the page.

    Parameters
    ----------
    world : World
        Which may go on changing. The page shows it as it stands now, and as it stands at every `WorldViewer.update`.
    clearance : float
        Pairs at most so far apart are listed [m].
    min_depth : float
        Overlaps proven less deep than this are a class of their own [m].
    title : str
        Of the page.
    port : int
        Of the server; 0 for one that is free.
    rate : float
        Pages hear of at most so many moments a second; those between are left out, the last never is.
    browser : bool
        Open the page in the user's browser.

    Returns
    -------
    WorldViewer
        Its ``url`` is where the page is.

    Raises
    ------
    InvalidArgument
        For arguments of another kind, and where the port is taken.
    """
    viewer = WorldViewer(world, clearance=clearance, min_depth=min_depth, title=title, port=port, rate=rate)
    if browser:
        webbrowser.open(viewer.url)
    return viewer


class WorldViewer:
    """A live page of a World, until it is closed or the program ends. As a context manager it closes itself.

    Parameters
    ----------
    world, title, port, rate
        As of `view`.
    clearance, min_depth : float
        As of `view` [m].

    Raises
    ------
    InvalidArgument
        As of `view`.

    Notes
    -----
    The page is served by threads of this process, on the loopback address, under a random address; who has ``url`` and
    an account on this machine can read it.
    """

    def __init__(
        self, world: World, *, clearance: float = 0.0, min_depth: float = 0.0, title: str = "World", port: int = 0,
        rate: float = 30.0,
    ) -> None:
        self._world = checks.instance("view: world", world, World, "a collide.World")
        self._title = checks.text("view: title", title)
        self._limits = Limits(checks.length("view: clearance", clearance), checks.length("view: min_depth", min_depth))
        moments = checks.number(rate)
        if moments is None or not 0 < moments < math.inf:
            raise InvalidArgument(f"view: rate must be a number of moments a second above 0, got {brief(rate)}")
        if checks.integer("view: port", port, 0) > 65535:
            raise InvalidArgument(f"view: port must be within 0 … 65535, 0 for one that is free, got {brief(port)}")
        scene = scene_of_world(world, self._title)
        self._drawn = _what_is_drawn(scene)
        self._server = LiveServer(WorldState(scene, 0, self._limits), int(port), moments)
        atexit.register(self.close)

    @property
    def url(self) -> str:
        """Where the page is: on this machine, with a random token in it."""
        return self._server.url

    @property
    def closed(self) -> bool:
        """Whether the page is served no more."""
        return self._server.closed

    def update(self, label: str | None = None) -> None:
        """Show the World as it stands now.

        Parameters
        ----------
        label : str, optional
            A line about this moment, such as its time; None for none.

        Raises
        ------
        InvalidArgument
            Where the viewer is closed.

        Notes
        -----
        The World is copied, about 3 µs a body, and tested by another thread if a page listens:
        what a World refuses to answer is said on the page. Bodies that were added or removed make pages load again.
        """
        if self.closed:
            raise InvalidArgument("the viewer is closed: make another with collide.adapters.view(world)")
        scene = scene_of_world(self._world, self._title)
        drawn, number = _what_is_drawn(scene), self._server.state.drawing
        if drawn != self._drawn:
            self._drawn, number = drawn, number + 1
        self._server.show(WorldState(scene, number, self._limits, None if label is None else str(label)))

    def close(self) -> None:
        """Stop serving; pages say that they are no longer live. A second time it does nothing."""
        self._server.close()
        atexit.unregister(self.close)

    def __enter__(self) -> WorldViewer:  # noqa: PYI034 - Self is of Python 3.11
        return self

    def __exit__(self, *exception) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<WorldViewer of {self._title}, {'closed' if self.closed else self.url}>"

    def _repr_html_(self) -> str:
        """The page inside a notebook."""
        if self.closed:
            return f"<p>The viewer of {html.escape(self._title)} is closed.</p>"
        return (
            f'<iframe src="{html.escape(self.url)}" title="{html.escape(self._title)}" width="100%" height="640" '
            'style="border: 0"></iframe>'
        )


def _what_is_drawn(scene: SceneOfWorld) -> list[tuple]:
    """What a page cannot change by moving bodies. Shapes are immutable, and held here: no other has the id of one."""
    return [(body.name, body.shape, body.static, body.group, body.mask) for body in scene.bodies]
