"""The command ``collide view``: its arguments, and its work. Imports the standard library alone before the run."""

from __future__ import annotations

import argparse
import os
import threading
from collections.abc import Callable

from collide.cli import pages as cli_pages
from collide.cli import scenes as cli_scenes

EPILOG = """examples:
  collide view workcell
  collide view cell.yaml --clearance 5cm          edit cell.yaml, and see
  collide view robot.urdf cell.yaml --trajectory plan.csv
  collide view panda_workbench --no-browser --port 8765

The page of `collide report --html`, served on this machine alone while the
command runs. When a file that it was made from is written again, the page is
made anew; where it cannot be, the page says why and keeps what it had.

The address holds a random word, and is printed: who has it and is on this
machine can look. From another machine: ssh -L 8765:127.0.0.1:8765 HOST, and
--port 8765 here.

From Python, a World that moves: collide.adapters.view(world).

exit status: 0 ended by Ctrl-C, 2 error"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("view")
    group.add_argument("--port", type=_port, default=0, metavar="N", help="of the page's server (one that is free)")
    group.add_argument("--no-browser", action="store_true", help="print the address, open nothing")
    parser.add_argument("--quiet", action="store_true", help="no progress; the address and errors are still told")


def run(args: argparse.Namespace, progress: Callable, started: float, say: Callable[[str], None]) -> int:
    """Serve the page until Ctrl-C; gives the exit status, 0.

    started : ``time.perf_counter()`` when the command began.   say : writes a line to stderr.
    """
    from collide.adapters.live.scene_viewer import SceneViewer

    begins = [started]

    def make(number: int):
        return _page(args, progress, begins.pop() if begins else None, number)

    viewer = SceneViewer(make, args.port)
    try:
        print(viewer.url, flush=True)
        say("Ctrl-C ends it" + (f"; watching {', '.join(viewer.files[:3])}" if viewer.files else ""))
        if not args.no_browser:
            import webbrowser

            webbrowser.open(viewer.url)
        viewer.follow(threading.Event(), changed=lambda: say(viewer.problem or "read again"))
    except KeyboardInterrupt:
        say("ended")
    finally:
        viewer.close()
    return 0


def _page(args: argparse.Namespace, progress: Callable, started: float | None, number: int) -> tuple[str, list[str]]:
    """The text of the page, and its source files."""
    from collide.adapters.live.page_state import live_block
    from collide.pages.page_file import page_pieces

    made = cli_scenes.reports(args, progress, started, clearance=args.clearance)
    scene = made[0].scene
    with progress("drawing"):
        blocks = [*cli_pages.blocks_of_report(args, made), live_block(number)]
        text = "".join(page_pieces(f"collide view: {scene.name}", blocks, live=True))
    return text, _files(args, [source for stated in made for source in stated.scene.sources])


def _files(args: argparse.Namespace, sources: list[str]) -> list[str]:
    """The files named as arguments, and files reached from them, each once."""
    words = [*args.scenes, *(args.state or []), args.trajectory, args.robot, args.srdf, *sources]
    return list(dict.fromkeys(os.path.abspath(word) for word in words if word and os.path.isfile(word)))


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"must be 0 … 65535, got {text!r}")
    return int(text)
