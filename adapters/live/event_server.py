"""A small server on this machine alone: one page, and the events that keep it as the world is.

It is bound to the loopback address. A web page elsewhere cannot read it either: the address holds a random token, a
request must name this server in its Host header (a name that was rebound to 127.0.0.1 does not), and no answer carries
a header that would let another origin read it. Nothing is taken from a request but its path, and nothing is served but
the page and its events.
"""

from __future__ import annotations

import errno
import hmac
import json
import logging
import secrets
import threading
import time
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from collide.adapters.live import page_state
from collide.adapters.live.page_state import PageState
from collide.errors import CollideError, InvalidArgument

LOOPBACK = "127.0.0.1"
#: Pages that may listen at a time: each has a thread.
MAX_PAGES = 32
#: A silent connection is kept alive by a comment after so long [s]; one that takes nothing ends after twice that.
_ALIVE_SECONDS = 15.0
#: What an interrupted page waits before it asks again [ms].
_RETRY = 1000
#: How long `LiveServer.close` waits for pages to hear of it [s].
_LAST_WORDS = 1.0
_PORT_ERRORS = {errno.EADDRINUSE: "is taken", errno.EACCES: "needs a privilege"}
_log = logging.getLogger("collide")


class LiveServer:
    """Shows a `PageState`, and every later one, to the pages that listen.

    state : what the first page shows.   port : 0 for one that is free.
    rate : a page hears of at most so many moments a second; those between are left out, the last never is.
    """

    def __init__(self, state: PageState, port: int = 0, rate: float = 30.0):
        self._state, self._closed, self._n_pages = state, False, 0
        self._changed = threading.Condition()
        self._seconds_between = 1.0 / rate
        self._token = secrets.token_urlsafe(24)
        self._http = _listening(port, self)
        self.port: int = self._http.server_address[1]
        self._thread = threading.Thread(
            target=self._http.serve_forever, kwargs={"poll_interval": 0.1}, name="collide view", daemon=True
        )
        self._thread.start()

    @property
    def url(self) -> str:
        """Where the page is; the token in it is all that is needed to read it."""
        return f"http://{LOOPBACK}:{self.port}/{self._token}/"

    @property
    def closed(self) -> bool:
        return self._closed

    @property
    def state(self) -> PageState:
        return self._state

    def show(self, state: PageState) -> None:
        """Let pages show another moment. Returns at once: what it takes to test it is done where a page listens."""
        with self._changed:
            self._state = state
            self._changed.notify_all()

    def close(self) -> None:
        """Tell pages that nothing more comes, and stop serving. Once closed, nothing happens."""
        with self._changed:
            if self._closed:
                return
            self._closed = True
            self._changed.notify_all()
            deadline = time.monotonic() + _LAST_WORDS
            while self._n_pages and (remaining := deadline - time.monotonic()) > 0:
                self._changed.wait(remaining)
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()

    # --- for the threads of the pages -----------------------------------------------------------

    def knows(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self._token.encode())

    def is_addressed(self, host: str | None) -> bool:
        """Whether a Host header names this server."""
        return host in (f"{LOOPBACK}:{self.port}", f"localhost:{self.port}")

    def enter(self) -> bool:
        """Count a page that listens; False where there are too many, or the server is closed."""
        with self._changed:
            if self._closed or self._n_pages >= MAX_PAGES:
                return False
            self._n_pages += 1
            return True

    def leave(self) -> None:
        with self._changed:
            self._n_pages -= 1
            self._changed.notify_all()

    def wait_for_other(self, state: PageState | None) -> PageState | None:
        """A state that is not this one, as soon as there is one; None after a while without, and once closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._state is not state, _ALIVE_SECONDS)
            return self._state if self._state is not state and not self._closed else None

    def pause(self) -> None:
        """What keeps pages to ``rate``."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed, self._seconds_between)


class _HttpServer(ThreadingHTTPServer):
    live: LiveServer

    def handle_error(self, request, client_address) -> None:
        """A browser that goes away is no error; the rest is for the log, not for stderr."""
        _log.debug("collide view: a connection ended", exc_info=True)


def _listening(port: int, live: LiveServer) -> _HttpServer:
    try:
        server = _HttpServer((LOOPBACK, port), _Handler)
    except OverflowError:
        raise InvalidArgument(f"port must be within 0 … 65535, got {port}") from None
    except OSError as error:
        why = _PORT_ERRORS.get(error.errno or 0, error.strerror)
        raise InvalidArgument(f"port {port} {why}: give another, or 0 for one that is free") from None
    server.live = live
    return server


class _Handler(BaseHTTPRequestHandler):
    """One request: the page, or its events."""

    server: _HttpServer
    server_version, sys_version = "collide", ""
    timeout = 2 * _ALIVE_SECONDS

    def do_GET(self) -> None:
        live = self.server.live
        if not live.is_addressed(self.headers.get("Host")):
            self._answer(HTTPStatus.FORBIDDEN, "this server answers under its own address alone")
            return
        path, _, query = self.path.partition("?")
        _, token, name = path.split("/") if path.count("/") == 2 else ("", "", "")
        if not live.knows(token) or name not in ("", "events"):
            self._answer(HTTPStatus.NOT_FOUND, "nothing is here")
        elif name == "":
            self._page(live)
        else:
            self._events(live, query.removeprefix("drawing="))

    def _page(self, live: LiveServer) -> None:
        try:
            text = "".join(live.state.page()).encode()
        except CollideError as error:
            self._answer(HTTPStatus.INTERNAL_SERVER_ERROR, f"the page cannot be made: {error}")
            return
        self._head(HTTPStatus.OK, "text/html; charset=utf-8", len(text))
        self.wfile.write(text)

    def _answer(self, status: HTTPStatus, text: str) -> None:
        data = f"{text}\n".encode("utf-8", "replace")
        self._head(status, "text/plain; charset=utf-8", len(data))
        self.wfile.write(data)

    def _head(self, status: HTTPStatus, kind: str, length: int | None = None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        if length is not None:
            self.send_header("Content-Length", str(length))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()

    def _events(self, live: LiveServer, drawing: str) -> None:
        if not live.enter():
            self._answer(HTTPStatus.SERVICE_UNAVAILABLE, f"{MAX_PAGES} pages listen already, or the server is closed")
            return
        try:
            self._head(HTTPStatus.OK, "text/event-stream; charset=utf-8")
            self._write(f"retry: {_RETRY}\n\n")
            self._follow(live, drawing)
        except (ConnectionError, TimeoutError):
            _log.debug("collide view: a page went away")
        finally:
            live.leave()

    def _follow(self, live: LiveServer, drawing: str) -> None:
        """Tell a page of every moment until the server is closed or the page goes away."""
        seen: PageState | None = None
        tested: PageState | None = None
        problem: str | None = None
        while not live.closed:
            state = live.wait_for_other(seen)
            if state is None:
                self._write(": alive\n\n")
                continue
            seen = state
            if str(state.drawing) != drawing:
                self._event(page_state.RELOAD, {})
                return
            update, wrong = None, state.problem
            try:
                update, tested = state.update(tested), state
            except CollideError as error:
                wrong = str(error)
            if update is not None:
                self._write(f"event: {page_state.UPDATE}\ndata: {update}\n\n")
            if wrong != problem:
                self._event(page_state.PROBLEM, {"text": wrong})
                problem = wrong
            live.pause()
        self._event(page_state.CLOSED, {})

    def _event(self, name: str, data: dict) -> None:
        self._write(f"event: {name}\ndata: {json.dumps(data)}\n\n")

    def _write(self, text: str) -> None:
        self.wfile.write(text.encode())
        self.wfile.flush()

    def log_message(self, format: str, *args) -> None:
        """Requests are nobody's business, and their paths hold the token."""
