"""What a call costs through the C interface, beside the same call from Python.

    python benchmarks/c_interface.py

Compiles a loop in C against the installed library with the compiler $CC, else cc. ns of the processor a call;
both ask the same pairs at the same poses.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from inputs import ball, poses

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, main
from collide.adapters.bench.turns import Seconds

POSES = 64
LOOP = r"""
#include <collide.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}
int main(int count, char **given)
{
    static double A[64 * 16], B[64 * 16], points[3 * 128];
    collide_shape *shapes[2] = {NULL, NULL};
    collide_workspace *w = NULL;
    double size[3] = {1.0, 1.2, 0.8}, best[2] = {1e9, 1e9};
    int which, round, k, r, hit = 0;
    collide_pair pair;
    FILE *file = fopen(given[1], "rb");
    if (count != 2 || fread(A, 8, 1024, file) != 1024 || fread(B, 8, 1024, file) != 1024) return 1;
    if (fread(points, 8, 384, file) != 384) return 1;
    collide_workspace_create(&w);
    for (which = 0; which < 2; which++) {
        if (which == 0) collide_box(size, &shapes[0]); else collide_hull(points, 128, 0.0, &shapes[1]);
        best[0] = best[1] = 1e9;
        for (round = 0; round < 15; round++) {
            double t0 = now(), t1, t2;
            for (r = 0; r < 20; r++)
                for (k = 0; k < 64; k++)
                    collide_collide(w, shapes[which], shapes[which], A + 16 * k, B + 16 * k, 0, &hit);
            t1 = now();
            for (r = 0; r < 20; r++)
                for (k = 0; k < 64; k++)
                    collide_distance(w, shapes[which], shapes[which], A + 16 * k, B + 16 * k, INFINITY, 0, &pair);
            t2 = now();
            if (t1 - t0 < best[0]) best[0] = t1 - t0;
            if (t2 - t1 < best[1]) best[1] = t2 - t1;
        }
        printf("%.1f %.1f\n", best[0] / 1280 * 1e9, best[1] / 1280 * 1e9);
    }
    return 0;
}
"""


@cache
def pairs() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    X, Y = poses(rng, POSES, 0.0), poses(rng, POSES, 0.0)
    Y[:, :3, 3] = 1.5 * rng.normal(size=(POSES, 3))
    return X, Y, ball(128)


@cache
def in_c() -> list[list[float]]:
    """ns a boolean and a distance, of boxes and of hulls, the least of 15 rounds."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        source, program, data = folder / "loop.c", folder / "loop", folder / "poses"
        source.write_text(LOOP, encoding="utf-8")
        data.write_bytes(b"".join(array.tobytes() for array in pairs()))
        library = Path(collide.get_library())
        command = [os.environ.get("CC", "cc"), "-O2", f"-I{collide.get_include()}", str(source), "-o", str(program)]
        subprocess.run([*command, str(library), f"-Wl,-rpath,{library.parent}", "-lm"], check=True)
        output = subprocess.run([str(program), str(data)], check=True, capture_output=True, text=True).stdout
    return [[float(number) for number in line.split()] for line in output.splitlines()]


def measure(options: Options, shapes: str, question: str) -> Race:
    X, Y, points = pairs()
    shape = collide.Box((1, 1.2, 0.8)) if shapes == "two boxes" else collide.ConvexHull(points)
    ask, asked = getattr(collide, question), list(zip(X, Y))
    ns = in_c()[shapes != "two boxes"][question == "distance"]
    tasks = {"C": lambda: Seconds(ns * 1e-9 * POSES), "Python": lambda: [ask(shape, shape, *at) for at in asked]}
    return Race(tasks, POSES)


def cases(options: Options):
    return grid(shapes=("two boxes", "hulls of 128"), question=("collide", "distance"))


CLAIMS = [Claim("c_interface", "ns a call", cases, measure, unit="ns", turns=15)]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
