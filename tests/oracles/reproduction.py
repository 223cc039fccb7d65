"""What fails on a random case is reported as source that asks the same again."""

from __future__ import annotations

from contextlib import contextmanager


@contextmanager
def reproducing(source: str, **values):
    """Whatever fails inside is reported with ``source``, its {names} filled in to the last digit.

    with reproducing("from collide.numerics.digits import lowest_bit; print(lowest_bit({x}))", x=x): ...
    """
    __tracebackhide__ = True
    try:
        yield
    except Exception as error:
        text = source.format(
            **{name: repr(value.tolist() if hasattr(value, "tolist") else value) for name, value in values.items()}
        )
        raise AssertionError(f"{type(error).__name__}: {error}\n\n{text}\n") from error
