"""A World: bodies with names, filters between them, and what became of every pair."""

import collide

world = collide.World()
# Static bodies are never tested against each other: how a table stands on the floor is nobody's news.
world.add(collide.Halfspace((0, 0, 1), 0.0), name="floor", static=True)
world.add(collide.Box((1.2, 0.8, 0.04)), collide.pose((0, 0, 0.7)), name="table", static=True)
# A compound is the union of posed shapes: one body, several convex parts.
mug = collide.Compound([
    (collide.Cylinder(radius=0.04, length=0.1), collide.pose()),
    (collide.Box((0.03, 0.012, 0.06)), collide.pose((0.05, 0, 0))),
])
world.add(mug, collide.pose((0.3, 0.1, 0.769)), name="mug")
world.add(collide.Sphere(0.03), collide.pose((0.42, 0.1, 0.76)), name="orange")
world.add(collide.Box((0.1, 0.02, 0.06)), collide.pose((-0.2, 0, 0.9)), name="gripper")
world.add(collide.Box((0.06, 0.06, 0.06)), collide.pose((-0.2, 0.03, 0.9)), name="part")
# Groups and masks: a pair is tested when (group_A & mask_B) and (group_B & mask_A). This zone is in
# group 2, and only what has bit 2 in its mask is tested against it; the default mask has every bit.
world.add(collide.Box((1, 1, 1)), collide.pose((-0.8, 0, 1.2)), name="camera view", static=True, group=2)
# The gripper holds the part: that contact is wanted.
world.allow("gripper", "part", reason="grasped")

near = world.distances(max_distance=0.05)  # every tested pair not farther apart, hits included
print("pairs within 5 cm")
for row, (a, b) in zip(near, near.names):
    what = "depth" if row["hit"] else "gap"
    print(f"  {a:8} {b:12} {what:5} {abs(row['distance']) * 1000:8.3f} mm   certified {row['certified']}")

print("\nwhat became of every pair")
stats = world.stats
for reason, pairs in stats["skipped"].items():
    print(f"  {pairs:2} {reason}")
print(f"  {stats['narrowphase']:2} answered pair by pair: {stats['how']}")
print(f"  {stats['pairs']:2} in all")

world.set_pose("mug", collide.pose((0.3, 0.1, 0.7711)))  # 1.1 mm over the table
print("\nmug lifted; collisions left:", world.collisions().names)
