"""Questions of four threads at once, about shapes and a World that they share: the answers of one thread, byte by byte.

    python tests/soak/soak_threads.py --pairs 400 --rounds 5

Every thread asks everything, in an order of its own: single calls, batches, contacts, and the World while another
thread moves its bodies back and forth. Without Python's lock (a free-threaded build) the threads run at the same time;
with the lock they take turns.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import threading
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1] / "oracles")]

import numpy as np
import soak_pairs

import collide
from collide.base.free_threads import FREE_THREADED

THREADS = 4


def fresh_pairs(n: int, seed: int) -> list[tuple]:
    """(A, B, X_WA, X_WB) of all kinds. Shapes are new: nothing has been made ready for them."""
    drawn = [soak_pairs.draw(seed, number, 1e3) for number in range(n)]
    return [(case.A, case.B, case.X_WA, case.X_WB) for case in drawn]


def answers(pairs: list[tuple], order) -> list[bytes | str]:
    """Of each pair by number: a boolean, a distance, contacts and a batch, or the kind of error."""
    found: list[bytes | str] = [""] * len(pairs)
    for k in order:
        A, B, X_WA, X_WB = pairs[k]
        try:
            hit = collide.collide(A, B, X_WA, X_WB)
            near = collide.distance(A, B, X_WA, X_WB)
            batch = collide.distance(A, B, X_WA[None], np.stack([X_WB, X_WA]))
            touching = collide.contacts(A, B, X_WA, X_WB)
            found[k] = bytes([hit]) + near.rows.tobytes() + batch.rows.tobytes() + touching.rows.tobytes()
        except collide.CollideError as error:
            found[k] = type(error).__name__
    return found


def crowd(seed: int) -> tuple[collide.World, np.ndarray, list[np.ndarray]]:
    """(World, its bodies that move, two lists of their poses)."""
    rng, world = np.random.default_rng(seed), collide.World()
    for A, B, *_ in fresh_pairs(40, seed + 1):
        for shape in (A, B):
            if not shape.is_region:
                world.add(shape, collide.pose(rng.uniform(-1.0, 1.0, 3)))
    ids = world.ids[::2]
    poses = [np.array([collide.pose(rng.uniform(-1.0, 1.0, 3)) for _ in ids]) for _ in range(2)]
    return world, np.asarray(ids), poses


def ask_crowd(world: collide.World) -> bytes:
    return world.collisions().rows.tobytes() + bytes([world.collides()])


class Failures(list):
    """What went otherwise, of all threads."""


def run_round(n: int, seed: int) -> Failures:
    """Four threads over the same new shapes and one World, against one thread over others like them."""
    expected = answers(fresh_pairs(n, seed), range(n))
    world, ids, poses = crowd(seed)
    known = set()
    for X in poses:
        world.set_poses(ids, X)
        known.add(ask_crowd(world))
    pairs, failures, is_over = fresh_pairs(n, seed), Failures(), threading.Event()
    begin = threading.Barrier(THREADS + 1)

    def ask(thread: int) -> None:
        begin.wait()
        try:
            order = np.random.default_rng([seed, thread]).permutation(n) if thread else np.arange(n)
            for part in np.array_split(order, 8):
                found = answers(pairs, part)
                failures.extend((seed, int(k)) for k in part if found[k] != expected[k])
                if ask_crowd(world) not in known:
                    failures.append((seed, "World"))
        except BaseException as error:  # noqa: BLE001 - in a thread, where nobody sees it
            failures.append((seed, thread, repr(error)))

    def change() -> None:
        begin.wait()
        while not is_over.is_set():
            for X in poses:
                world.set_poses(ids, X)

    threads = [threading.Thread(target=ask, args=(thread,)) for thread in range(THREADS)]
    changing = threading.Thread(target=change)
    for thread in (*threads, changing):
        thread.start()
    for thread in threads:
        thread.join()
    is_over.set()
    changing.join()
    assert len(set(expected)) > 0.9 * n and len(known) == 2, "answers that are all alike would say nothing"
    return failures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=400, help="of a round")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parsed = parser.parse_args()
    failures = [run_round(parsed.pairs, parsed.seed + 1000 * number) for number in range(parsed.rounds)]
    total = sum(map(len, failures))
    asked = THREADS * parsed.pairs * parsed.rounds
    print(
        f"{'without' if FREE_THREADED else 'with'} Python's lock: {asked} pairs asked by {THREADS} threads, "
        f"{total} with other answers than one thread has"
    )
    for failure in list(itertools.chain(*failures))[:10]:
        print(failure)
    sys.exit(bool(total))


if __name__ == "__main__":
    main()
