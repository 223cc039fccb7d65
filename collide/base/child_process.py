"""Processes serving this process: started, asked, waited for up to a time limit, the reason of their end told.

A child runs ``module:function`` as ``function(requests, send, *arguments)``: ``requests`` yields the parent's messages,
``send`` answers, both over a connection of `multiprocessing`. The process is a plain interpreter:
processes of `multiprocessing` run the caller's script anew, and the script needs ``if __name__ == "__main__"``.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import re
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from importlib import import_module
from multiprocessing import connection as connections
from typing import Any

#: How many characters of a dead child's stderr are told.
LAST_WORDS = 240
#: How long a child that has closed its connection may take to end [s].
_LEAVING = 5.0


class ChildProcess:
    """A child process, ended with this object, or with this process, however this process ends.

    Output of libraries in the child goes to stderr. The child ignores SIGINT: the interrupted parent ends the child.

    Parameters
    ----------
    serve : str
        ``"module:function"``, found on this process's `sys.path`.
    *arguments
        Arguments of the function, picklable.
    keep_stderr : bool
        Keep the child's stderr for `how_it_ended`; otherwise the child writes to this process's stderr.
    """

    def __init__(self, serve: str, *arguments: Any, keep_stderr: bool = True):
        self._connection, theirs = connections.Pipe()
        self._stderr = tempfile.TemporaryFile() if keep_stderr else None  # noqa: SIM115 - closed by `close`
        code = (
            f"import sys; sys.path[:] = {[str(folder) for folder in sys.path]}; "
            f"from collide.base.child_process import _serve; _serve({theirs.fileno()}, {serve!r})"
        )
        # The child's stdin carries nothing: its end is how the child learns of ours.
        self._process = subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stderr=self._stderr, **_inheriting(theirs.fileno())
        )
        theirs.close()
        self._outbox: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._sender = threading.Thread(target=self._send_all, daemon=True)
        self._sender.start()
        self.send(arguments)

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def send(self, message: Any) -> None:
        """Hand over a message: pickled now, written by a thread, so that no child holds this process up."""
        self._outbox.put(pickle.dumps(message, protocol=5))

    def receive(self, limit: float | None = None) -> Any:
        """The next message.

        Parameters
        ----------
        limit : float, optional
            The longest wait [s]; ``None`` waits for ever.

        Raises
        ------
        EOFError
            After the child's end: `how_it_ended` tells why.
        TimeoutError
            After a silence longer than the limit.
        """
        try:
            if self._connection.poll(limit):
                return self._connection.recv()
        except OSError:
            raise EOFError from None
        raise TimeoutError

    def how_it_ended(self) -> str:
        """Signal or exit code of an ended child, and the last words of its stderr, in a line."""
        try:
            code = self._process.wait(_LEAVING)
        except subprocess.TimeoutExpired:
            return "process stopped answering while it ended"
        how = f"process ended with code {code}"
        if code < 0:
            known = {number.value: number.name for number in signal.Signals}
            how = f"process aborted ({known.get(-code, f'signal {-code}')})"
        if self._stderr is None:
            return how
        self._stderr.seek(0)
        words = last_words(self._stderr.read().decode(errors="replace"))
        return f"{how}: {words}" if words else how

    def kill(self) -> None:
        """End the process while another thread is still waiting for a message; `close` is left to the waiting
        thread.
        """
        self._process.kill()

    def close(self) -> None:
        """End the process, and give back what it took."""
        self.kill()
        self._process.wait()
        self._outbox.put(None)
        self._sender.join(_LEAVING)  # what it still had to write fails, since nobody reads
        self._connection.close()
        for stream in (self._process.stdin, self._stderr):
            if stream is not None:
                stream.close()

    def _send_all(self) -> None:
        with contextlib.suppress(OSError):  # the child is dead, which `receive` tells
            while (message := self._outbox.get()) is not None:
                self._connection.send_bytes(message)


def last_words(stderr: str) -> str:
    """The last words of a dead process, in a short line without folders.

    An uncaught C++ exception prints its message first and its details after; of
    anything else the end matters most.
    """
    text = re.sub(r"(?:/[\w.+-]+)+/(?=[\w.+-])", "", " ".join(stderr.split()))
    _, separator, message = text.rpartition("what(): ")
    return message[:LAST_WORDS] if separator else text[-LAST_WORDS:]


def _inheriting(handle: int) -> dict[str, Any]:
    """What makes `subprocess.Popen` hand a connection's handle on, and no other."""
    if sys.platform != "win32":
        return {"pass_fds": [handle]}
    os.set_handle_inheritable(handle, True)
    startup = subprocess.STARTUPINFO()
    startup.lpAttributeList = {"handle_list": [handle]}
    return {"startupinfo": startup}


# --- in the child ----------------------------------------------------------------------------------


def _serve(handle: int, serve: str) -> None:
    """All that a child does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "win32":
        ours = connections.PipeConnection(handle)
    else:
        ours = connections.Connection(handle)
        os.set_inheritable(handle, False)
    _end_with_the_parent(os.dup(0))
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    requests = _received(ours)
    for arguments in requests:
        module, _, name = serve.partition(":")
        getattr(import_module(module), name)(requests, ours.send, *arguments)
        break


def _received(ours: Any) -> Iterator[Any]:
    """What the parent sends, until it is gone."""
    while True:
        try:
            message = ours.recv()
        except (EOFError, OSError):
            return
        yield message


def _end_with_the_parent(lifeline: int) -> None:
    """End this process when a pipe, whose other end the parent holds, is closed."""
    if sys.platform == "linux":  # by a signal: a library that hangs may hold the interpreter's lock, and no thread runs
        import fcntl

        signal.signal(signal.SIGIO, signal.SIG_DFL)
        fcntl.fcntl(lifeline, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(lifeline, fcntl.F_SETFL, fcntl.fcntl(lifeline, fcntl.F_GETFL) | os.O_ASYNC)

    def wait() -> None:
        os.read(lifeline, 1)
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
