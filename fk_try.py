import numpy as np, collide, time
rng=np.random.default_rng(1)
for n in ("panda","fetch","ur5"):
    r=collide.Robot.load(f"/work/shared/data/robots/{n}/{n}.urdf")
    lo=np.where(np.isfinite(r.lower),r.lower,-3);hi=np.where(np.isfinite(r.upper),r.upper,3)
    Q=rng.uniform(lo,hi,(10000,r.dof))
    X=r.link_poses(Q)
    t=time.perf_counter();X=r.link_poses(Q);t=time.perf_counter()-t
    print(n,t/10000*1e6)
    np.save(f"/tmp/fk_{n}_{'new' if hasattr(collide,'x') else ''}.npy",X[:50])
