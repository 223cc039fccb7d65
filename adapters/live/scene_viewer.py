"""Looking at the files of a scene while they are edited: the page is made anew when one of them changes."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable

from collide.adapters.live.event_server import LiveServer
from collide.adapters.live.page_state import SceneState
from collide.errors import CollideError

#: What a file was when it was last looked at: when it was written [ns] and its size; None where there is none.
Stamp = tuple[int, int] | None


class SceneViewer:
    """A live page that is made from files, and made again when one of them changes.

    Parameters
    ----------
    make : function of the number of the page
        Gives the text of the page, with `page_state.live_block` of that number in it, and the files that it was made
        from. CollideError where they cannot be read.
    port : as of `LiveServer`.

    Raises
    ------
    CollideError : of ``make``, for the first page; InvalidArgument where the port is taken.
    """

    def __init__(self, make: Callable[[int], tuple[str, Iterable[str]]], port: int = 0):
        self._make = make
        text, files = make(0)
        self._stamps = stamps(files)
        self._server = LiveServer(SceneState(text, 0), port)

    @property
    def url(self) -> str:
        return self._server.url

    @property
    def files(self) -> list[str]:
        """What is watched."""
        return list(self._stamps)

    @property
    def problem(self) -> str | None:
        """Why the files cannot be shown as they are now; pages say so, and show the last that could."""
        return self._server.state.problem

    def look(self) -> bool:
        """Look at the files once; True where one had changed, and so the page, or what is said on it."""
        now = stamps(self._stamps)
        if now == self._stamps:
            return False
        self._stamps = now
        state = self._server.state
        assert isinstance(state, SceneState)
        try:
            text, files = self._make(state.drawing + 1)
        except (CollideError, OSError) as error:
            self._server.show(state.with_problem(str(error)))
            return True
        # a file that was written again meanwhile is looked at next time
        self._stamps = {**stamps(files), **{file: stamp for file, stamp in now.items() if file in set(files)}}
        self._server.show(SceneState(text, state.drawing + 1))
        return True

    def follow(self, stop: threading.Event, seconds: float = 0.5, changed: Callable[[], None] = lambda: None) -> None:
        """Look every so many seconds until ``stop`` is set.   changed : called after each look that found something."""
        while not stop.wait(seconds):
            if self.look():
                changed()

    def close(self) -> None:
        """Stop serving; pages say that they are no longer live."""
        self._server.close()


def stamps(files: Iterable[str]) -> dict[str, Stamp]:
    """File → its stamp."""
    return {file: _stamp(file) for file in files}


def _stamp(file: str) -> Stamp:
    try:
        status = os.stat(file)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
