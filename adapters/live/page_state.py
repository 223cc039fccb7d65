"""What live pages show at one moment, and what a page that shows an earlier moment has to be told.

A page is drawn once. Afterwards bodies move and verdicts change by events, one line of JSON each:

========= ==================================================================================================
update    ``poses`` [[body row, 12 numbers: rows of [R|p]]…] and ``verdicts`` [[body row, class]…] that changed,
          ``report`` and ``label``
reload    other bodies or shapes: the page has to be loaded again
problem   ``text`` of what is wrong just now, null where nothing is
closed    the program that showed the page has ended
========= ==================================================================================================
"""

from __future__ import annotations

import json
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from collide.adapters.live.scene_of_world import SceneOfWorld
from collide.errors import CollideError
from collide.pages import drawing
from collide.pages.body_verdicts import body_verdicts
from collide.pages.page_file import DataBlock, ReportBlock, page_pieces
from collide.reports import report as reports
from collide.reports.report import Report

UPDATE, RELOAD, PROBLEM, CLOSED = "update", "reload", "problem", "closed"
_ENCODE = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode


class Limits(NamedTuple):
    """What a report is asked [m]: pairs up to ``clearance`` are listed, overlaps below ``min_depth`` are shallow."""

    clearance: float = 0.0
    min_depth: float = 0.0


class PageState(ABC):
    """One moment. ``drawing`` numbers what is drawn: a page of another number has to be loaded again."""

    drawing: int

    @abstractmethod
    def page(self) -> Iterable[str]:
        """The whole page as pieces of text. Raises CollideError where it cannot be made."""

    @abstractmethod
    def update(self, since: PageState | None) -> str | None:
        """The data of an update for a page that shows ``since`` (None: the page as it was loaded); None: nothing.

        Raises CollideError where the moment cannot be tested.
        """

    @property
    @abstractmethod
    def problem(self) -> str | None:
        """What is wrong at this moment."""


def live_block(number: int) -> DataBlock:
    """The block that makes a page live: where it hears of events, relative to where it came from."""
    return DataBlock("live", {"events": f"events?drawing={number}"})


class SceneState(PageState):
    """A page that was made whole from files; what changes it is another one.

    text : of the page, its `live_block` in it.   drawing : its number.   problem : with the files, since it was made.
    """

    def __init__(self, text: str, drawing: int, problem: str | None = None):
        self._text, self.drawing, self._problem = text, drawing, problem

    def page(self) -> Iterable[str]:
        return [self._text]

    def update(self, since: PageState | None) -> str | None:
        return None

    @property
    def problem(self) -> str | None:
        return self._problem

    def with_problem(self, problem: str | None) -> SceneState:
        """The same page, something being wrong with its files."""
        return SceneState(self._text, self.drawing, problem)


class WorldState(PageState):
    """A World as it stood. It is tested when somebody looks, and once however many do.

    scene : of the World.   drawing : number of its bodies.   limits : of the report.
    label : a line about the moment, such as its time.
    """

    problem = None

    def __init__(self, scene: SceneOfWorld, drawing: int, limits: Limits, label: str | None = None):
        self.scene, self.drawing, self.label, self._limits = scene, drawing, label, limits
        self.poses = np.array([body.X_WB[:3].ravel() for body in scene.bodies]).reshape(len(scene.bodies), 12)
        self._lock = threading.Lock()
        self._tested: tuple[Report, list[str], str] | None = None
        self._refused: CollideError | None = None

    def tested(self) -> tuple[Report, list[str], str]:
        """(the report, the verdict of every body by row, the report as one line of JSON). Raises CollideError."""
        with self._lock:
            if self._refused is not None:
                raise self._refused
            if self._tested is None:
                try:
                    report = reports.make(self.scene, self._limits.clearance, self._limits.min_depth)
                except CollideError as error:
                    self._refused = error
                    raise
                verdicts = list(body_verdicts(self.scene, report).values())
                self._tested = report, verdicts, _ENCODE(report.to_dict())
            return self._tested

    def page(self) -> Iterable[str]:
        report = self.tested()[0]
        drawn = drawing.of_scene(self.scene, report)
        blocks: list[ReportBlock | DataBlock] = [
            ReportBlock("report", report.items()), DataBlock("drawing", drawn), live_block(self.drawing),
        ]
        return page_pieces(f"collide view: {self.scene.name}", blocks, live=True)

    def update(self, since: PageState | None) -> str | None:
        _, verdicts, report = self.tested()
        rows, before = np.arange(len(verdicts)), [""] * len(verdicts)
        if isinstance(since, WorldState):
            rows = np.flatnonzero((self.poses != since.poses).any(axis=1))
            if not len(rows) and self.scene.allowed == since.scene.allowed and self.label == since.label:
                return None
            before = since.tested()[1]
        moved = [[row, numbers] for row, numbers in zip(rows.tolist(), (self.poses[rows] + 0.0).tolist())]
        changed = [[row, verdict] for row, verdict in enumerate(verdicts) if verdict != before[row]]
        head = _ENCODE({"poses": moved, "verdicts": changed, "contacts": None, "label": self.label})
        return f'{head[:-1]},"report":{report}}}'
