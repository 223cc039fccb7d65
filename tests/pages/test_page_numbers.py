"""Numbers of the page are the terminal's, digit by digit and unit by unit."""

from __future__ import annotations

import numpy as np
import pytest
from page_module import call

from collide.reports import number_format


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20261201)


def lengths(rng: np.random.Generator) -> list[float]:
    """Of every size, with signs, zeros, ends of units, and decimals that lie halfway between two."""
    sizes = 10.0 ** rng.uniform(-14, 9, 1500)
    ends = [m * 10.0**k for k in range(-10, 8) for m in (1.0, 9.9949, 9.995, 9.99949999, 0.0995, 5.0)]
    halfway = (2 * rng.integers(0, 2**14, 300) + 1) / 2.0 ** rng.integers(1, 14, 300)
    values = [*sizes, *ends, *halfway, *(halfway * 1e-3), 0.0]
    return [float(value * sign) for value, sign in zip(values, rng.choice([-1.0, 1.0], len(values)))]


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [("briefLength", number_format.brief_length), ("columnLength", lambda v: number_format.lengths([v])[0])],
)
def test_lengths_are_written_as_in_the_terminal(rng, ours, theirs):
    values = lengths(rng)
    assert call("lengths", ours, [[v] for v in values]) == [theirs(v) for v in values]


def test_volumes_and_seconds_are_written_as_in_the_terminal(rng):
    values = np.abs(lengths(rng)).tolist()
    assert call("lengths", "volumeText", [[v] for v in values]) == [number_format.volume(v) for v in values]
    assert call("lengths", "secondsText", [[v] for v in values]) == [number_format.seconds(v) for v in values]


def test_columns_have_one_unit_as_in_the_terminal(rng):
    columns = [(10.0 ** rng.uniform(-9, 3) * rng.uniform(-1, 1, rng.integers(1, 9))).tolist() for _ in range(300)]
    columns += [[], [None], [None, 0.02, 3e-5], [0.0, 0.0], [0.0, -2e-8]]
    texts = call("lengths", "", columns, run="return each.map(module.columnFormat(each))")
    for column, text in zip(columns, texts):
        wanted = number_format.lengths([np.inf if value is None else value for value in column])
        assert text == [entry.strip() for entry in wanted]


def test_the_example_of_the_overlap_reads_as_in_the_terminal():
    assert call("lengths", "volumeText", [[0.00008410928510265143], [0.0]]) == ["84.11 cm³", "0 mm³"]
