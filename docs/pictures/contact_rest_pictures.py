"""The rest picture of docs/contacts.md: bodies as in `tests/contact/test_rest.py` for ten seconds, by its stepper.

    python docs/pictures/contact_rest_pictures.py      # half a minute; needs matplotlib; writes docs/pictures/rest.png
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "contact"), str(ROOT / "tests" / "oracles"), str(ROOT / "tests" / "mesh")]
from contact_scenes import table
from stepper import Step, Stepper

import collide

matplotlib.use("Agg")
from matplotlib import pyplot

FILE = ROOT / "docs" / "pictures" / "rest.png"
SECONDS = 10.0
FLOOR, X_FLOOR = collide.Box((4, 4, 0.5)), collide.pose((0, 0, -0.25))


def box_inertia(size) -> np.ndarray:
    x, y, z = np.square(size)
    return np.array([y + z, x + z, x + y]) / 12


def rod_inertia(radius: float, length: float) -> np.ndarray:
    across = (3 * radius**2 + length**2) / 12
    return np.array([across, across, radius**2 / 2])


def stack() -> Stepper:
    rng = np.random.default_rng(3)
    size, stepper = (0.4, 0.3, 0.2), Stepper()
    stepper.add(FLOOR, X_FLOOR)
    for k in range(10):
        x, y, yaw = rng.uniform(-1, 1, 3) * (0.02, 0.02, 0.3)
        stepper.add(collide.Box(size), collide.pose((x, y, 0.2 * (k + 0.5)), rpy=(0, 0, yaw)), 1.0, box_inertia(size))
    return stepper


def dropped(ground, X_WA, shape, inertia, place, rpy, velocity=(0.0,) * 6) -> Stepper:
    stepper = Stepper(margin=0.01, max_contacts=12)
    stepper.add(ground, X_WA)
    stepper.add(shape, collide.pose(place, rpy=rpy), 1.0, inertia, velocity)
    return stepper


def scenes() -> dict[str, Stepper]:
    size = (0.3, 0.2, 0.1)
    rod, quarter = rod_inertia(0.1, 0.5), 0.5 * np.pi
    mesh = collide.Mesh(*table(5))
    corners = np.array([(x, y, z) for x in (-0.15, 0.15) for y in (-0.1, 0.1) for z in (-0.05, 0.05)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    cube = collide.Mesh(corners, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    cylinder = collide.Cylinder(0.1, 0.5)
    return {
        "ten boxes, stacked": stack(),
        "a tilted box, sliding": dropped(
            FLOOR, X_FLOOR, collide.Box(size), box_inertia(size), (-0.5, 0, 0.12), (0.3, 0.2, 0.5), (1, 0.2, 0, 0, 0, 0)
        ),
        "a cylinder set on its end": dropped(FLOOR, X_FLOOR, cylinder, rod, (0, 0, 0.256), (0.05, 0.02, 0.3)),
        "a cylinder on its side": dropped(FLOOR, X_FLOOR, cylinder, rod, (0, 0, 0.1), (quarter, 0, 0.3)),
        "a cylinder on its side, on a mesh": dropped(mesh, np.eye(4), cylinder, rod, (0, 0, 0.1), (quarter, 0, 0.3)),
        "a mesh dropped on a mesh": dropped(mesh, np.eye(4), cube, box_inertia(size), (0, 0, 0.12), (0.3, 0.2, 0.5)),
    }


def changes(steps: list[Step]) -> np.ndarray:
    """Contacts that came or went, up to each step."""
    counts = [len(set(a.keys) ^ set(b.keys)) for a, b in pairwise(steps)]
    return np.cumsum([0, *counts])


def main() -> None:
    figure, (speeds, energies, contacts) = pyplot.subplots(1, 3, figsize=(14, 4))
    for title, stepper in scenes().items():
        energy = [stepper.energy()]
        steps = [stepper.step() for _ in range(round(SECONDS / stepper.dt))]
        energy += [step.energy for step in steps]
        time = stepper.dt * np.arange(len(steps))
        speeds.semilogy(time, [max(np.abs(step.V).max(), 1e-17) for step in steps], label=title, linewidth=1)
        energies.plot(time, np.array(energy[1:]) - energy[0], linewidth=1)
        contacts.plot(time, changes(steps), linewidth=1)
        print(f"{title}: fastest at the end {np.abs(steps[-1].V).max():.1e}, contacts {len(steps[-1].keys)}")
    speeds.set(title="fastest of all bodies [m/s, rad/s]", xlabel="time [s]")
    energies.set(title="energy, since the start [J]", xlabel="time [s]")
    contacts.set(title="contacts that came or went, in all", xlabel="time [s]")
    figure.legend(loc="lower center", ncol=3, frameon=False)
    figure.tight_layout(rect=(0, 0.13, 1, 1))
    figure.savefig(FILE, dpi=90)
    print(f"written: {FILE.name}")


if __name__ == "__main__":
    main()
