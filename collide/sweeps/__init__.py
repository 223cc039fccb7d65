"""Many configurations of a robot: verdicts in files, resumed after an interruption, and the pairs of links able to
meet.

`sweep` asks a RobotChecker about millions of configurations, in processes of this machine or on Dask, and writes
Parquet. `propose_disabled_pairs` samples configurations and proposes pairs of links that need no test.
"""
