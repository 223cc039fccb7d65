"""Many configurations of a robot: verdicts in files that a run can go on with, and which of its links can meet at all.

`sweep` asks a RobotChecker about millions of configurations, in processes of this machine or on Dask, and writes
Parquet. `propose_disabled_pairs` samples configurations and proposes which pairs of links need no test.
"""
