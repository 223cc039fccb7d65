"""An engine in a child process that stays alive from question to question, and is started anew where it dies."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from collide.adapters.peers import protocol
from collide.adapters.peers.child import IsolatedPeer

#: Deaths without a single answer between them, after which an engine is given up for the question at hand.
MAX_IDLE_DEATHS = 5


class EngineSession(IsolatedPeer):
    """One engine, asked question after question.

    Parameters
    ----------
    name : str
        A name of `collide.adapters.peers.protocol.ENGINES`.
    timeout : float
        How long it may be silent about one pair [s].
    """

    _stays = _counts_idle_deaths = True

    def __init__(self, name: str, timeout: float = 5.0):
        protocol.check_names([name])
        super().__init__(protocol.ENGINES[name], timeout=timeout, max_restarts=MAX_IDLE_DEATHS)

    @contextmanager
    def hurried(self, seconds: float) -> Iterator[None]:
        """With a shorter time limit for a while.

        Parameters
        ----------
        seconds : float
            The limit, where it is below the session's own [s].
        """
        patient, self.timeout = self.timeout, min(self.timeout, seconds)
        try:
            yield
        finally:
            self.timeout = patient
