"""The shipped work cell: an arm over a bench, its joints moved; numpy is enough."""

import numpy as np

from collide.scenes import load

scene = load("workcell")  # a shipped scene; a path to a file of your own works the same
print(f"{scene.name}: {len(scene.bodies)} bodies, robots {', '.join(scene.robots)}")
arm = scene.robots["arm"]
print("joints:", ", ".join(f"{n} {lo:g}…{hi:g}" for n, lo, hi in zip(arm.joint_names, arm.lower, arm.upper)))
print("shipped at:", scene.state)


def of_robot(world, rows):
    """The pairs in which a link takes part, deepest first."""
    links = {body.name for body in scene.bodies if body.owner}
    pairs = zip(rows["distance"], rows.names)
    return sorted((float(d), a, b) for d, (a, b) in pairs if links & {a, b})


world = scene.world()
print("\nas shipped, within 5 cm of a link or in it:")
for distance, a, b in of_robot(world, world.distances(max_distance=0.05)):
    print(f"  {a:14} {b:12} {distance * 1000:9.3f} mm")

# Turn the first joint through its range and see where the arm is free. Only poses change, so the World
# keeps its packed shapes and refits its box-tree.
first = arm.joint_names[0]
print(f"\nsweeping {first}:")
for angle in np.arange(-9, 10, 3) / 10:
    moved = scene.with_state({first: angle})  # a new Scene; the old one stays as it is
    world.set_poses([body.name for body in moved.bodies], np.array([body.X_WB for body in moved.bodies]))
    hits = of_robot(world, world.collisions())
    report = ", ".join(f"{a} in {b} by {-d * 1000:.1f} mm" for d, a, b in hits[:2]) or "free"
    print(f"  {angle:5.2f} rad: {report}{', …' if len(hits) > 2 else ''}")
