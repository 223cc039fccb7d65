"""Every engine and setting by name, each with where to load it from when it is first asked for."""

from __future__ import annotations

_HERE = "collide.adapters.peers"
#: Each as ``module:class`` or ``module:class:setting``. A name with a setting, ``engine:setting``, is the same engine
#: asked in another way: `collide.adapters.peers.protocol.Peer.settings`.
ENGINES = {
    "collide": f"{_HERE}.collide_peer:CollidePeer",
    "fcl": f"{_HERE}.fcl_peer:FclPeer",
    "fcl:indep": f"{_HERE}.fcl_peer:FclPeer:indep",
    "coal": f"{_HERE}.coal_peer:CoalPeer",
    "coal:tight": f"{_HERE}.coal_peer:CoalPeer:tight",
    "coal:nesterov": f"{_HERE}.coal_peer:CoalPeer:nesterov",
    "coal:polyak": f"{_HERE}.coal_peer:CoalPeer:polyak",
    "pybullet": f"{_HERE}.pybullet_peer:PybulletPeer",
    "pybullet:margins": f"{_HERE}.pybullet_peer:PybulletPeer:margins",
    "mujoco": f"{_HERE}.mujoco_peer:MujocoPeer",
    "mujoco:libccd": f"{_HERE}.mujoco_peer:MujocoPeer:libccd",
    "mujoco:distance": f"{_HERE}.mujoco_peer:MujocoPeer:distance",
    "mujoco:distance-libccd": f"{_HERE}.mujoco_peer:MujocoPeer:distance-libccd",
    "drake": f"{_HERE}.drake_peer:DrakePeer",
    "drake:penetration": f"{_HERE}.drake_peer:DrakePeer:penetration",
    "trimesh": f"{_HERE}.trimesh_peer:TrimeshPeer",
    "rapier": f"{_HERE}.rapier_peer:RapierPeer",
    "rapier:cast": f"{_HERE}.rapier_peer:RapierPeer:cast",
    "rapier:nonlinear": f"{_HERE}.rapier_peer:RapierPeer:nonlinear",
    "distance3d": f"{_HERE}.distance3d_peer:Distance3dPeer",
    "distance3d:original": f"{_HERE}.distance3d_peer:Distance3dPeer:original",
    "distance3d:nesterov": f"{_HERE}.distance3d_peer:Distance3dPeer:nesterov",
    "distance3d:epa": f"{_HERE}.distance3d_peer:Distance3dPeer:epa",
    "distance3d:mpr": f"{_HERE}.distance3d_peer:Distance3dPeer:mpr",
    "newton": f"{_HERE}.newton_peer:NewtonPeer",
    "cgal": f"{_HERE}.cgal_peer:CgalPeer",
    "exact": f"{_HERE}.exact_peer:ExactPeer",
}
