"""A World on a live page: what pages hear when it changes, who may listen, and what happens at the end."""

from __future__ import annotations

import copy
import http.client
import json
import re
import socket
import threading
import time

import numpy as np
import pytest

import collide
import collide.adapters
from collide.adapters.live.event_server import MAX_PAGES
from collide.errors import InvalidArgument, InvalidPose


class Listener:
    """A page without a browser: what it loaded, and the events it hears, one after the other."""

    def __init__(self, viewer, host: str | None = None):
        self._place = re.fullmatch(r"http://127\.0\.0\.1:(\d+)(/[\w-]+/)", viewer.url)
        self.host = host
        response = self.get("")
        text = response.read().decode()
        assert response.status == 200, text
        self.page = {
            name: json.loads(data)
            for name, data in re.findall(r'<script type="application/json" id="(\w+)">(.*?)</script>', text, re.DOTALL)
        }
        self.policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
        self.stream = self.get(self.page["live"]["events"])
        assert self.stream.status == 200
        assert self.stream.headers["Content-Type"].startswith("text/event-stream")

    def get(self, path: str, method: str = "GET"):
        connection = http.client.HTTPConnection("127.0.0.1", int(self._place[1]), timeout=20)
        connection.putrequest(method, self._place[2] + path, skip_host=self.host is not None)
        if self.host is not None:
            connection.putheader("Host", self.host)
        connection.endheaders()
        return connection.getresponse()

    def hear(self) -> tuple[str, dict]:
        """The next event, comments left out."""
        name = None
        for line in iter(self.stream.readline, b""):
            field, _, value = line.decode().rstrip("\n").partition(": ")
            if field == "event":
                name = value
            elif field == "data":
                return name, json.loads(value)
        raise AssertionError("the stream ended")


@pytest.fixture
def world():
    world = collide.World()
    world.add(collide.Box((2, 1, 0.04)), name="table", static=True)
    world.add(collide.Sphere(0.1), collide.pose((0, 0, 0.5)), name="</script><b>ball & co")
    world.add(collide.Capsule(0.05, 0.2), collide.pose((0.5, 0, 0.5)), name="arm")
    return world


@pytest.fixture
def viewer(world):
    with collide.adapters.view(world, clearance=0.02) as viewer:
        yield viewer


def test_a_page_has_what_the_world_has(viewer):
    page = Listener(viewer).page
    assert page["report"]["schema"].startswith("collide-report/")
    assert [body["name"] for body in page["drawing"]["bodies"]] == ["table", "</script><b>ball & co", "arm"]
    assert page["drawing"]["bodies"][1]["X_WB"][11] == 0.5


def test_the_first_event_tells_everything_and_later_ones_what_changed(world, viewer):
    listener = Listener(viewer)
    name, data = listener.hear()
    assert name == "update"
    assert [row for row, _ in data["poses"]] == [0, 1, 2]
    assert data["verdicts"] == [[0, "free"], [1, "free"], [2, "free"]]
    world.set_pose("arm", collide.pose((0.5, 0.25, 0.1)))
    viewer.update("t = 1")
    name, data = listener.hear()
    assert name == "update" and data["label"] == "t = 1"
    assert data["poses"] == [[2, [1, 0, 0, 0.5, 0, 1, 0, 0.25, 0, 0, 1, 0.1]]]
    assert data["verdicts"] == [[0, "colliding"], [2, "colliding"]]
    # 0.1 + 0.05 of the capsule below its centre, the table's top at 0.02
    (pair,) = data["report"]["colliding"]
    assert {pair["a"], pair["b"]} == {"table", "arm"}
    assert abs(pair["depth"] - 0.07) < 1e-12
    world.set_pose("arm", collide.pose((0.5, 0.25, 0.18)))
    viewer.update()
    name, data = listener.hear()
    assert data["verdicts"] == [[0, "near"], [2, "near"]]
    assert abs(data["report"]["near"][0]["distance"] - 0.01) < 1e-12


def test_a_page_that_sums_up_events_shows_the_world(world, viewer):
    """Random moves, faster than events come: in the end a page stands where the World stands, and no later."""
    seed = 23
    rng = np.random.default_rng(seed)
    listener = Listener(viewer)
    poses, verdicts, n_events = {}, {}, 0
    for step in range(40):
        body = int(rng.integers(1, 3))
        world.set_pose(body, collide.pose(rng.uniform(-0.3, 0.3, 3)))
        viewer.update(f"step {step}")
        if step % 8 == 7:
            label = None
            while label != f"step {step}":
                name, data = listener.hear()
                n_events += 1
                assert name == "update"
                poses.update((row, numbers) for row, numbers in data["poses"])
                verdicts.update((row, verdict) for row, verdict in data["verdicts"])
                label = data["label"]
            for row, identity in enumerate(world.ids):
                shown = np.array(poses[row]).reshape(3, 4)
                assert (shown == world.body(identity).X_WB[:3]).all(), f"seed {seed}, step {step}: body {row}"
            hits = {i for row in world.collisions().rows for i in (int(row["a"]), int(row["b"]))}
            assert {row for row, verdict in verdicts.items() if verdict == "colliding"} == hits, f"seed {seed}, {step}"
    assert 5 <= n_events <= 41  # one at the start, one a moment at most


def test_other_bodies_make_pages_load_again(world, viewer):
    listener = Listener(viewer)
    listener.hear()
    world.add(collide.Box((0.1, 0.1, 0.1)), collide.pose((0, 0, 2)), name="new")
    viewer.update()
    assert listener.hear() == ("reload", {})
    again = Listener(viewer)
    assert len(again.page["drawing"]["bodies"]) == 4
    assert again.hear()[0] == "update"
    world.remove("new")
    viewer.update()
    assert again.hear() == ("reload", {})


def test_allowing_a_pair_reaches_the_page(world, viewer):
    world.set_pose("arm", collide.pose((0.5, 0.25, 0.0)))
    viewer.update()
    listener = Listener(viewer)
    assert len(listener.hear()[1]["report"]["colliding"]) == 1
    world.allow("arm", "table", reason="on purpose")
    viewer.update()
    data = listener.hear()[1]
    assert data["report"]["colliding"] == [] and data["poses"] == []
    assert data["report"]["skipped"][0]["reason"] == "on purpose"


def test_a_world_that_is_refused_is_a_line_on_the_page(world, viewer):
    listener = Listener(viewer)
    listener.hear()
    world.add(collide.Halfspace((0, 0, 1), -1.0), name="ground", static=True)
    world.add(collide.Halfspace((0, 0.1, 1), -1.0), name="slope")
    viewer.update()
    assert listener.hear()[0] == "reload"
    report = Listener(viewer).page["report"]
    assert {report["colliding"][0]["a"], report["colliding"][0]["b"]} == {"ground", "slope"} or report["unanswered"]


def test_the_world_itself_is_left_as_it_was(world):
    world.set_pose("arm", collide.pose((0.5, 0.25, 0.0)))
    assert world.collides()
    before = copy.deepcopy(world.stats)
    with collide.adapters.view(world, clearance=1.0) as viewer:
        listener = Listener(viewer)
        listener.hear()
        viewer.update("again")
        listener.hear()
    assert world.stats == before


# --- who may listen -------------------------------------------------------------------------------


def answer_to(port: int, request: bytes) -> str:
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        connection.sendall(request)
        return b"".join(iter(lambda: connection.recv(65536), b"")).decode()


def test_only_loopback_the_token_and_the_right_host(viewer):
    listener = Listener(viewer)
    port = int(re.search(r":(\d+)/", viewer.url)[1])
    token = viewer.url.split("/")[3]
    assert len(token) >= 32
    for host in (f"evil.example:{port}", "evil.example", "127.0.0.1", f"127.0.0.1.evil.example:{port}", ""):
        listener.host = host
        for path in ("", "events?drawing=0"):
            assert listener.get(path).status == 403, (host, path)
    listener.host = f"localhost:{port}"
    assert listener.get("").status == 200
    listener.host = None
    for path in (
        f"/{token[:-1]}/", "/", "//", "", "*", f"/{token}", f"/{token}/../etc/passwd", f"/{token}/report.json", "/é/",
        f"http://127.0.0.1:{port}/x/", "/[::1/",
    ):
        answer = answer_to(port, f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        # without a path the request is one of HTTP/0.9, whose answers have no status
        assert re.match(r"HTTP/1.0 404 ", answer) or (path == "" and answer == "nothing is here\n"), (path, answer)
        assert token not in answer
    for method in ("POST", "PUT", "DELETE", "OPTIONS"):
        assert listener.get("", method).status == 501, method


def test_the_address_is_this_machine_alone(viewer):
    assert viewer._server._http.server_address[0] == "127.0.0.1"


def test_answers_let_no_other_page_read_them(viewer):
    listener = Listener(viewer)
    headers = listener.get("").headers
    assert not [name for name in headers if name.lower().startswith("access-control")]
    assert headers["Cache-Control"] == "no-store" and headers["Referrer-Policy"] == "no-referrer"
    assert "default-src 'none'" in listener.policy and "connect-src 'self'" in listener.policy


def test_tokens_are_never_the_same(world):
    with collide.adapters.view(world) as one, collide.adapters.view(world) as two:
        assert one.url.split("/")[3] != two.url.split("/")[3]


def test_pages_that_listen_are_so_many_at_most(viewer):
    first = Listener(viewer)
    streams = [first.get("events?drawing=0") for _ in range(MAX_PAGES - 1)]
    assert {stream.status for stream in streams} == {200}
    assert first.get("events?drawing=0").status == 503


# --- the end --------------------------------------------------------------------------------------


def test_pages_hear_of_the_end(world):
    viewer = collide.adapters.view(world)
    listener = Listener(viewer)
    listener.hear()
    url, n_threads = viewer.url, threading.active_count()
    start = time.perf_counter()
    viewer.close()
    assert time.perf_counter() - start < 5.0  # not the quarter of a minute after which a silent page is looked at
    assert listener.hear() == ("closed", {})
    assert viewer.closed and url not in repr(viewer) and "closed" in viewer._repr_html_()
    viewer.close()
    with pytest.raises(InvalidArgument, match="viewer is closed"):
        viewer.update()
    with pytest.raises(ConnectionError):
        listener.get("")
    assert threading.active_count() < n_threads


def test_in_a_notebook_it_is_a_frame(viewer):
    assert f'<iframe src="{viewer.url}"' in viewer._repr_html_()


def test_a_page_that_goes_away_is_forgotten(world, viewer):
    listener = Listener(viewer)
    listener.hear()
    listener.stream.close()
    deadline = time.monotonic() + 10
    while viewer._server._n_pages and time.monotonic() < deadline:
        world.set_pose("arm", collide.pose((0.5, 0, 0.5 + 0.1 * (time.monotonic() % 1))))
        viewer.update()
        time.sleep(0.02)
    assert viewer._server._n_pages == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"clearance": -1}, "clearance must be a number, finite and not negative"),
        ({"min_depth": float("nan")}, "min_depth must be a number, finite"),
        ({"rate": 0}, "rate must be a number of moments"),
        ({"port": "80"}, "port must be an integer"),
        ({"port": 70000}, "port must be within"),
    ],
)
def test_arguments_are_refused_by_name(world, arguments, words):
    with pytest.raises(InvalidArgument, match=words):
        collide.adapters.view(world, **arguments)


def test_a_port_that_is_taken_is_said(world, viewer):
    port = int(re.search(r":(\d+)/", viewer.url)[1])
    with pytest.raises(InvalidArgument, match=rf"port {port} is taken: give another"):
        collide.adapters.view(world, port=port)
    with pytest.raises(InvalidArgument, match=r"world must be a collide\.World, got {}"):
        collide.adapters.view({})


def test_moves_that_are_refused_leave_the_page(world, viewer):
    listener = Listener(viewer)
    listener.hear()
    with pytest.raises(InvalidPose):
        world.set_pose("arm", np.zeros((4, 4)))
    viewer.update("still there")
    data = listener.hear()[1]
    assert data["poses"] == [] and data["label"] == "still there"
