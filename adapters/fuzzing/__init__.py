"""Other engines searched for wrong answers: scenes invented, disagreements judged exactly, shrunk and written down.

`fuzz_run` is the search, `disagreements` what is wrong with an answer, `shrink` how a case gets small, `findings` what
is kept of it. `fcl_dump` reads what FCL prints when it aborts, `recorders` write scenes of live programs.
"""
