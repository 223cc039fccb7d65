"""Objects of hosts whose fields are worked out when one of the fields is first read.

Programs ask whether two bodies meet a thousand times for each contact that they look at; a contact's geometry takes 10
to 1,000 times as long as the boolean.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class FieldsWhenRead:
    """Base of a host's contacts and results."""

    #: Names of the fields that may be worked out later.
    _later: tuple[str, ...] = ()

    def _postpone(self, work: Callable[..., tuple], *question: Any) -> None:
        """Empties the fields; ``work(*question)`` returns their values, in the order of `_later`, when one is read."""
        held = self.__dict__
        if "_work" not in held:
            for name in self._later:
                held.pop(name, None)
        held["_work"] = work, question

    def __getattr__(self, name: str):  # of what is not there yet
        if name not in self._later or "_work" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__} has no {name}")
        held = self.__dict__
        work, question = held["_work"]
        fields = dict(zip(self._later, work(*question)))
        fields.update(held)  # a field that was set meanwhile stays
        held.update(fields)
        held.pop("_work", None)
        return held[name]

    def __dir__(self):
        return [*super().__dir__(), *self._later]

    def __getstate__(self) -> dict:
        """For copies: all fields, worked out, so that a copy can be pickled and shares no work."""
        if "_work" in self.__dict__:
            for name in self._later:
                getattr(self, name)
        return self.__dict__.copy()
