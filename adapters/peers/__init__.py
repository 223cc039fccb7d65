"""Other engines, asked the same question as collide: same scene in, same result table out.

`protocol` is the one interface, `compare` the judge of disagreements, `exact` the arithmetic that
settles them. An engine that can end the interpreter is asked in a child process (`child`).
"""
