"""One solid of several: a bracket drilled and welded together, what a clash takes away, and a patch of contact."""

import numpy as np

import collide

# A plate, a rib welded to it, and a bore through both.
identity = np.eye(4)
plate, rib, bore = collide.Box((0.2, 0.1, 0.01)), collide.Box((0.01, 0.1, 0.08)), collide.Box((0.03, 0.03, 0.3))
welded = collide.boolean(plate, rib, identity, collide.pose((0, 0, 0.045)), "union").mesh
bracket = collide.boolean(welded, bore, identity, collide.pose((0.06, 0, 0), rpy=(0, 0.3, 0)), "difference")
volume = bracket.mesh.report.volume
print(f"bracket: {volume * 1e6:.3f} cm³, {len(bracket.mesh.faces)} facets, solid: {bracket.mesh.solid}")
print(f"vertices were moved by at most {bracket.moved:.0e} m, {len(bracket.self_collisions)} facets cross")

# How bad is a clash? The volume that would have to be taken away, proven between two bounds, and where it is.
tool = collide.ConvexHull([(0, 0, 0), (0.02, 0, 0.1), (-0.02, 0, 0.1), (0, 0.02, 0.1), (0, -0.02, 0.1)])
clash = collide.overlap_volume(bracket.mesh, tool, identity, collide.pose((-0.05, 0, 0.002)))
print(f"clash: {clash.volume * 1e9:.4f} mm³, known to {(clash.upper - clash.lower) / clash.volume:.0e} of itself")
print("around", np.round(clash.centroid, 5), f"with {clash.area_b * 1e6:.3f} mm² of the tool inside")

# What only touches has no volume, and a patch.
table, block = collide.Box((0.5, 0.5, 0.125)), collide.Box((0.25, 0.25, 0.25))
rest = collide.overlap_volume(table, block, identity, collide.pose((0.125, 0, 0.1875)))
print(f"at rest: volume {rest.volume}, patch {rest.patch_area * 1e4:.2f} cm² around {np.round(rest.centroid, 4)}")

# Every pair of a World at once.
world = collide.World()
world.add(bracket.mesh, identity, name="bracket", static=True)
world.add(tool, collide.pose((-0.05, 0, 0.002)), name="tool")
for row, (a, b) in zip(overlaps := world.overlaps(), overlaps.names):
    print(f"{a} and {b}: {row['volume'] * 1e9:.4f} mm³")
