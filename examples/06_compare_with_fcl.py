"""The same scene asked of another engine, every disagreement settled by exact arithmetic."""

import sys

import collide
from collide.adapters.peers.compare import compare
from collide.adapters.peers.protocol import engine
from collide.scenes import Scene, SceneBody

ENGINE = "fcl"
if engine(ENGINE).missing():
    print(f"{engine(ENGINE).missing()}; this example compares with it: pip install 'collide-robotics[peers]'")
    sys.exit()


def stack(edge: float, gap: float) -> Scene:
    """Five cubes over each other, each turned a little; the gaps are rounded as the poses are."""
    cube = collide.Box((edge, edge, edge))
    heights = [k * (edge + gap) for k in range(5)]
    return Scene("stack", [
        SceneBody(f"cube {k}", cube, collide.pose((0, 0, z), rpy=(0, 0, 0.3 * k))) for k, z in enumerate(heights)
    ])


# The same question in decimetres and in micrometres. An engine whose tolerance is a fixed number of
# metres answers the first well and the second not; here every tolerance is relative to the pair.
for edge, gap in ((0.1, 1e-5), (1e-6, 1e-10)):
    comparison = compare(stack(edge, gap), engines=(ENGINE,), max_distance=edge)
    print(f"\ncubes of {edge} m, gaps of {gap} m: {comparison.pairs} pairs within {edge} m")
    for s in comparison.summaries:
        print(f"  {s.engine:8} {s.version:9} answered {s.answered}, wrong booleans {s.wrong}, "
              f"distances off by more than {comparison.tolerance:.0e} of the size: {s.wrong_distances}")
    # `exact_distance` is rational arithmetic on the numbers given: no rounding until it is printed.
    for d in comparison.disagreements[:4]:
        print(f"    {d.a}, {d.b}: {d.engine} says {d.distance}, collide {d.reference_distance}, "
              f"exactly {d.exact_distance}; wrong by {d.off} m: {', '.join(d.wrong)}")
    print("  pairs where collide is refuted:", comparison.ours_wrong)
