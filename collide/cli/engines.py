"""Names of engines on the command line: a name, several, all installed engines, or help about each."""

from __future__ import annotations

import argparse
import shutil

from collide.reports.tables import wrapped


def engines(text: str) -> list[str]:
    """Names separated by commas; "all" is every other engine that is installed, "help" prints the list and ends."""
    if text.strip() == "help":
        print("\n".join(listing(min(100, shutil.get_terminal_size().columns))))
        raise SystemExit(0)
    if text.strip() == "all":
        from collide.adapters.peers.protocol import installed

        return [name for name in installed() if name not in ("collide", "exact")]
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise argparse.ArgumentTypeError("names no engine: give one of fcl, coal, pybullet, or several with commas")
    return names


def one_engine(text: str) -> str:
    """A single name; "help" prints the list and ends."""
    return engines(text)[0] if text.strip() == "help" else text


def listing(width: int = 100) -> list[str]:
    """A line for every engine and setting: whether installed, its questions, its input, and unsupported pairs."""
    from collide.adapters.peers.protocol import ENGINES, load_engine

    lines = []
    for name, spec in ENGINES.items():
        peer = load_engine(spec)
        missing = peer.missing()
        state = f"{missing}: pip install 'collide-robotics[{peer.extra}]'" if missing else peer.version
        lines += [f"{name}  ({state})"]
        about = (("asked", (peer.about,)), ("receives", peer.receives), ("cannot answer", peer.cannot))
        for title, sentences in about:
            line = f"{title}: {'; '.join(sentences)}"
            lines += wrapped(line, width, indent=4, hanging=4) if sentences else []
    return lines
