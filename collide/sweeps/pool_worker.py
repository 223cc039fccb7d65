"""A process that answers chunks: questions come in frames on its input, answers leave in frames on its output.

    python -m collide.sweeps.pool_worker

The first frame is the question; then a chunk a frame. It ends with its input. It writes no file, so that it may be
killed at any time.
"""

from __future__ import annotations

import os
import pickle
import signal
import struct
from typing import Any, BinaryIO

from collide.errors import InvalidArgument

_LENGTH = struct.Struct("<Q")


def write_frame(stream: BinaryIO, blob: bytes) -> None:
    """A length and so many bytes."""
    stream.write(_LENGTH.pack(len(blob)))
    stream.write(blob)
    stream.flush()


def read_frame(stream: BinaryIO) -> bytes:
    """The bytes of a frame. Raises EOFError where the other end is gone."""
    (length,) = _LENGTH.unpack(_read(stream, _LENGTH.size))
    return _read(stream, length)


def _read(stream: BinaryIO, length: int) -> bytes:
    blob = stream.read(length)
    if len(blob) != length:
        raise EOFError
    return blob


def answer_frames(incoming: BinaryIO, outgoing: BinaryIO) -> None:
    """Answer until the input ends: ``(True, columns)``, or ``(False, error)`` where answering failed."""
    question = _question(read_frame(incoming))
    while True:
        chunk = pickle.loads(read_frame(incoming))
        answer: tuple[bool, Any]
        try:
            answer = True, question.answer(chunk)
        except Exception as error:  # noqa: BLE001 - whatever it is, the process that asked tells it
            answer = False, error
        write_frame(outgoing, _pickled(answer))


class _Unreadable:
    """Stands for a question that this process cannot read."""

    def __init__(self, error: Exception):
        self._error = error

    def answer(self, chunk: Any) -> Any:
        raise InvalidArgument(
            f"the processes of a sweep cannot read what they are asked: {self._error}; a class of your own "
            "must be of a module that they can import, not of the script itself"
        )


def _question(blob: bytes) -> Any:
    try:
        return pickle.loads(blob)
    except Exception as error:  # noqa: BLE001 - told at each chunk
        return _Unreadable(error)


def _pickled(answer: tuple[bool, Any]) -> bytes:
    try:
        return pickle.dumps(answer, protocol=5)
    except Exception as error:  # noqa: BLE001 - an error that does not pickle is told in words
        return pickle.dumps((False, RuntimeError(f"{type(answer[1]).__name__}: {answer[1]} ({error})")))


def run() -> None:
    """Serve the process that started this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who asks is interrupted, and closes the input
    incoming = os.fdopen(os.dup(0), "rb")
    outgoing = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what anything prints must not come between frames
    try:
        answer_frames(incoming, outgoing)
    except (EOFError, BrokenPipeError):
        return


if __name__ == "__main__":
    run()
