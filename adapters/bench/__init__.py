"""Run time against error, and against size: `collide bench pareto` and `collide bench scaling`.

Engines are those of `collide.adapters.peers.protocol`; inputs and truths are those of the hard families.
"""
