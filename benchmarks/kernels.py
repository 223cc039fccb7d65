"""Two installations, and the levels of processors of one, side by side: what a pair costs, in turns.

    python benchmarks/kernels.py --against ../older/.venv/bin/python       # this one and an older version
    python benchmarks/kernels.py --levels v2 v3 v4                         # the levels of this one's library
    python benchmarks/kernels.py --against … --repeats 3 --holding boxes

Each figure is CPU time of the process: ns a pair in batches, ns a call of single ones. A process answers each case
many times and tells the best; the processes of all contestants take turns, and their medians are compared. The
answers' bytes are hashed: contestants that differ in a bit are told. The first contestant is that of --against.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from functools import cache

from collide.adapters.bench.claims import Claim, Options, Race, main
from collide.adapters.bench.turns import Seconds
from collide.errors import CollideError

#: What every process runs: {case: [ns, hash]} on stdout.
WORK = r'''
import hashlib, json, sys, time
import numpy as np
import collide

only = sys.argv[1]
rng = np.random.default_rng(7)


def turns(n):
    q = rng.normal(size=(n, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    w, x, y, z = q.T
    return np.stack([1-2*(y*y+z*z), 2*(x*y-z*w), 2*(x*z+y*w), 2*(x*y+z*w), 1-2*(x*x+z*z), 2*(y*z-x*w),
                     2*(x*z-y*w), 2*(y*z+x*w), 1-2*(x*x+y*y)], axis=1).reshape(n, 3, 3)


def poses(n, reach):
    X = np.zeros((2, n, 4, 4))
    X[:, :, 3, 3] = 1.0
    for k in range(2):
        X[k, :, :3, :3] = turns(n)
    X[1, :, :3, 3] = rng.normal(size=(n, 3)) * reach
    return X


def ball(n):
    points = rng.normal(size=(n, 3))
    return collide.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None])


def grid(n):
    """A bumpy sheet of 2·n² triangles."""
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    points = np.stack([x.ravel(), y.ravel(), 0.2 * np.sin(5 * x.ravel()) * np.cos(4 * y.ravel())], axis=1)
    at = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = at, at + 1, at + n + 2, at + n + 1
    return collide.Mesh(points, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))


def best(ask, count, seconds=0.5):
    found, ended = [], time.perf_counter() + seconds
    ask()
    while time.perf_counter() < ended or len(found) < 5:
        begun = time.process_time()
        answer = ask()
        found.append(time.process_time() - begun)
    return min(found) / count * 1e9, answer


def hashed(answer):
    if hasattr(answer, "rows"):
        answer = answer.rows
    names = answer.dtype.names or [None]
    digest = hashlib.sha256()
    for name in names:
        digest.update(np.ascontiguousarray(answer[name] if name else answer).tobytes())
    return digest.hexdigest()[:12]


box, sphere, cylinder = collide.Box((1, 1.2, 0.8)), collide.Sphere(0.6), collide.Cylinder(0.5, 1.0)
cases = {}
for name, A, B, n, reach in (
    ("boxes", box, box, 20000, 1.0), ("box and sphere", box, sphere, 20000, 0.8),
    ("box and cylinder", box, cylinder, 4000, 0.8),
    ("hulls of 8", ball(8), ball(8), 8000, 1.2), ("hulls of 128", ball(128), ball(128), 4000, 1.2),
    ("hulls of 2048", ball(2048), ball(2048), 4000, 1.2), ("meshes of 800", grid(20), grid(20), 400, 1.0),
):
    X = poses(n, reach)
    cases[f"{name}: boolean"] = (lambda A=A, B=B, X=X: collide.collide(A, B, *X), n)
    signed = not name.startswith("mesh")
    cases[f"{name}: distance"] = (lambda A=A, B=B, X=X, s=signed: collide.distance(A, B, *X, signed=s), n)
X = poses(10000, 3.0)
for n in (1, 10, 100, 1000, 10000):
    calls = 1 + 500 // n
    cases[f"batch of {n}, boxes: boolean"] = (
        lambda n=n, calls=calls: [collide.collide(box, box, X[0][:n], X[1][:n]) for _ in range(calls)][-1],
        n * calls,
    )
X1 = poses(64, 1.5)
for name, A, B in (("boxes", box, box), ("hulls of 128", ball(128), ball(128)), ("sphere and box", sphere, box)):
    def singles(ask, A=A, B=B):
        pairs = list(zip(*X1)) * 20
        def run():
            for a, b in pairs:
                r = ask(A, B, a, b)
            return np.array([float(getattr(r, "distance", r))])
        return run, len(pairs)
    cases[f"single, {name}: boolean"] = singles(collide.collide)
    cases[f"single, {name}: distance"] = singles(collide.distance)
sizes = rng.uniform(0.5, 1.0, (2, 3000, 3)).tolist()
for name, make in (("boxes", collide.Box), ("spheres", lambda size: collide.Sphere(size[0]))):
    for question, ask in (("boolean", collide.collide), ("distance", collide.distance), ("contacts", collide.contacts)):
        def first(make=make, ask=ask):
            for a, b in zip(*sizes):
                r = ask(make(a), make(b), X1[0][0], X1[1][0])
            return np.array([r]) if r.__class__ is bool else r
        cases[f"first call, {name} made with it: {question}"] = first, 3000
told = {}
for name, (ask, count) in cases.items():
    if only == "names":
        told[name] = None
    elif only == name:
        ns, answer = best(ask, count)
        told[name] = ns, hashed(answer)
print(json.dumps(told))
'''


def run(python: str, level: str, only: str) -> dict:
    environment = {**os.environ, **({"COLLIDE_CPU": level} if level else {})}
    done = subprocess.run([python, "-c", WORK, only], cwd=tempfile.gettempdir(), env=environment, capture_output=True,
                          text=True, check=False)
    if done.returncode:
        raise CollideError(f"{python} failed: {done.stderr}")
    return json.loads(done.stdout)


@cache
def names() -> list[str]:
    return list(run(sys.executable, "", "names"))


def measure(options: Options, case: str) -> Race:
    contestants = {level or "this": (sys.executable, level) for level in options.levels}
    if options.against:
        contestants = {"other": (options.against, "")} | contestants
    bits = {name: run(*contestant, case)[case][1] for name, contestant in contestants.items()}
    first = next(iter(bits.values()))
    beside = {name: {"bits": "the same" if answer == first else "OTHER"} for name, answer in bits.items()}
    return Race({
        name: lambda of=contestant: Seconds(run(*of, case)[case][0] * 1e-9) for name, contestant in contestants.items()
    }, beside=beside)


def cases(options: Options):
    return [{"case": name} for name in names() if options.holding in name]


def arguments(parser) -> None:
    parser.add_argument("--against", metavar="PYTHON", help="an interpreter with another version of collide installed")
    parser.add_argument("--levels", nargs="*", default=[""], help="levels of this one's library, by default the best")
    parser.add_argument("--holding", default="", metavar="TEXT", help="cases whose names hold this")


CLAIMS = [Claim("kernels", "ns a pair, or a call", cases, measure, unit="ns", turns=5, seconds=600.0)]


if __name__ == "__main__":
    main(__doc__, CLAIMS, arguments)
