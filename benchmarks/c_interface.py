"""What a call costs through the C interface, beside the same call from Python.

    python benchmarks/c_interface.py

Compiles a loop in C against the installed library with the system's compiler ($CC, else cc). ns a call, the least of
several rounds; both ask the same pairs at the same poses.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

import collide

POSES, ROUNDS = 64, 15
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


def poses() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    X = np.zeros((2, POSES, 4, 4))
    X[:, :, 3, 3] = 1.0
    X[:, :, :3, :3] = np.linalg.qr(rng.normal(size=(2, POSES, 3, 3)))[0]
    X[:, :, :3, 2] *= np.linalg.det(X[:, :, :3, :3])[..., None]
    X[1, :, :3, 3] = 1.5 * rng.normal(size=(POSES, 3))
    points = rng.normal(size=(128, 3))
    return X[0], X[1], points / np.linalg.norm(points, axis=1)[:, None]


def in_c(folder: Path, X_WA, X_WB, points) -> list[list[float]]:
    source, program, data = folder / "loop.c", folder / "loop", folder / "poses"
    source.write_text(LOOP, encoding="utf-8")
    data.write_bytes(X_WA.tobytes() + X_WB.tobytes() + points.tobytes())
    library = Path(collide.get_library())
    command = [os.environ.get("CC", "cc"), "-O2", f"-I{collide.get_include()}", str(source), "-o", str(program)]
    subprocess.run([*command, str(library), f"-Wl,-rpath,{library.parent}", "-lm"], check=True)
    output = subprocess.run([str(program), str(data)], check=True, capture_output=True, text=True).stdout
    return [[float(number) for number in line.split()] for line in output.splitlines()]


def in_python(shape, X_WA, X_WB) -> list[float]:
    pairs, answers = list(zip(X_WA, X_WB)) * 20, []
    for ask in (collide.collide, collide.distance):
        best = float("inf")
        for _ in range(ROUNDS):
            start = time.process_time()
            for A, B in pairs:
                ask(shape, shape, A, B)
            best = min(best, time.process_time() - start)
        answers.append(best / len(pairs) * 1e9)
    return answers


def main() -> None:
    X_WA, X_WB, points = poses()
    with tempfile.TemporaryDirectory() as folder:
        c = in_c(Path(folder), X_WA, X_WB, points)
    print(f"{'ns a call':20} {'C boolean':>10} {'Python':>8} {'C distance':>11} {'Python':>8}")
    for (boolean, distance), (name, shape) in zip(
        c, (("two boxes", collide.Box((1, 1.2, 0.8))), ("hulls of 128", collide.ConvexHull(points)))
    ):
        python_seconds = in_python(shape, X_WA, X_WB)
        print(f"{name:20} {boolean:10.0f} {python_seconds[0]:8.0f} {distance:11.0f} {python_seconds[1]:8.0f}")


if __name__ == "__main__":
    main()
