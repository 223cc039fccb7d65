"""Numbers for people: the unit of each size, its digits at the ends of a unit's range, zeros without a sign."""

from __future__ import annotations

import math

import numpy as np
import pytest

from collide import InvalidArgument
from collide.reports.number_format import (
    UNITS,
    brief_length,
    coordinates,
    count,
    directions,
    lengths,
    parse_length,
    seconds,
    volume,
    widths,
)


def below(value: float) -> float:
    return math.nextafter(value, 0.0)


@pytest.mark.parametrize(("metres", "words"), [
    (0.0, "0 mm"), (1.0, "1 m"), (below(1.0), "1000 mm"), (-1.5, "-1.5 m"), (1e-3, "1 mm"), (0.999e-3, "999 µm"),
    (1e6, "1e+06 m"), (999999.0, "999999 m"), (1e-7, "0.1 µm"), (0.9e-7, "9e-08 m"),
])
def test_lengths_in_a_sentence_change_their_unit_at_round_numbers(metres, words):
    assert brief_length(metres) == words


@pytest.mark.parametrize(("metres", "words"), [
    (0.0, "0.000 mm"), (1e-4, "0.100 mm"), (below(1e-4), "100.000 µm"), (below(10.0), "10000.000 mm"),
    (10.0, "10.000 m"), (below(1e6), "1000000.000 m"), (1e6, "1.00e+06 m"), (1e-7, "0.100 µm"),
    (below(1e-7), "1.00e-07 m"), (math.inf, "unbounded"), (math.nan, "unbounded"),
])
@pytest.mark.parametrize("sign", [1, -1])
def test_lengths_of_a_column_change_their_unit_at_round_numbers(metres, words, sign):
    minus = "-" if sign < 0 and math.isfinite(metres) else ""
    assert lengths([sign * metres])[0].rstrip() == minus + words


def test_lengths_of_a_column_have_their_points_below_each_other():
    assert lengths([0.5, 12.0, 2e-3, math.inf]) == ["    0.500 m", "   12.000 m", "  0.00200 m", "unbounded  "]
    assert lengths([]) == []


def test_a_column_of_lengths_has_one_unit_and_three_digits_of_every_length():
    assert lengths([0.5, 20e-6, -1.04]) == ["  500.000 mm", "   0.0200 mm", "-1040.000 mm"]
    assert lengths([1e-3, 9e-16]) == ["   1.000 mm", "9.00e-13 mm"]
    rng = np.random.default_rng(4)
    for _ in range(200):
        values = 10.0 ** rng.uniform(-16, 7, 5) * rng.choice([-1, 1], 5)
        texts = lengths(values)
        units = {text.split()[1] for text in texts}
        assert len(units) == 1 and len({len(text) for text in texts}) == 1, texts
        metres = {"m": 1.0, "mm": 1e-3, "µm": 1e-6}[units.pop()]
        read = [float(text.split()[0]) * metres for text in texts]
        assert np.allclose(read, values, rtol=6e-3, atol=0.0), (values, texts)


@pytest.mark.parametrize(("cubic_metres", "words"), [
    (2.5, "2.5 m³"), (0.1, "0.1 m³"), (below(0.1), "1e+05 cm³"), (1e-7, "0.1 cm³"), (0.99e-7, "99 mm³"),
    (1e-12, "0.001 mm³"), (0.0, "0 mm³"),
])
def test_volumes_change_their_unit_at_a_tenth(cubic_metres, words):
    assert volume(cubic_metres) == words


@pytest.mark.parametrize(("largest", "unit", "number"), [
    (0.0, "m", "0.000"), (0.05, "m", "0.050"), (0.049, "mm", "49.000"), (1e-3 * 0.05, "mm", "0.050"),
    (0.049e-3, "µm", "49.000"), (1e-6 * 0.05, "µm", "0.050"), (4e-8, "m", "4.00e-08"),
])
@pytest.mark.parametrize("sign", [1, -1])
def test_coordinates_have_the_unit_of_the_largest(largest, unit, number, sign):
    minus = "-" if sign < 0 and largest else ""
    zero = "0.00e+00" if "e" in number else "0.000"
    assert coordinates([(0.0, sign * largest, 0.0)]) == (unit, [f"{zero} {minus}{number} {zero}"])
    assert coordinates([]) == ("m", [])


def test_coordinates_stand_below_each_other_axis_by_axis():
    assert coordinates([(1.0, -2.0, 30.0), (-1.5, 2.0, 4.0)]) == ("m", [" 1.000 -2.000 30.000", "-1.500  2.000  4.000"])


def test_what_rounds_to_zero_has_no_sign_and_the_others_have():
    assert directions([(-0.0, -0.004, 0.004)]) == ["0.00 0.00 0.00"]
    assert directions([(-0.006, -1.0, 1.0)]) == ["-0.01 -1.00 1.00"]


def test_widths_of_brackets():
    assert widths([0.0, 1.6e-12, math.inf, 0.5]) == ["exact", "2e-12 m", "unbounded", "5e-01 m"]


@pytest.mark.parametrize(("value", "words"), [
    (0.00994, "9.9 ms"), (0.00995, "10 ms"), (0.0123, "12 ms"), (0.0, "0.0 ms"), (0.9995, "1.00 s"),
    (0.9994, "999 ms"), (61.234, "61.23 s"),
])
def test_seconds_have_two_digits_or_three(value, words):
    assert seconds(value) == words


def test_counts():
    assert [count(n, "pair") for n in (0, 1, 2)] == ["0 pairs", "1 pair", "2 pairs"]
    assert [count(n, "body", "bodies") for n in (0, 1, 2)] == ["0 bodies", "1 body", "2 bodies"]


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize(("number", "value"), [("0", 0.0), ("2", 2.0), ("1e-3", 1e-3), (" +.5", 0.5), ("-0", 0.0)])
def test_lengths_are_read_in_every_unit(unit, number, value):
    assert parse_length(f"{number}{unit}") == parse_length(f"{number} {unit} ") == value * UNITS[unit]


@pytest.mark.parametrize(("text", "words"), [
    ("", "a number of metres or carry one of the units m, km, dm, cm, mm, um, nm, in, ft, got ''"),
    ("mm", "a number of metres or"), ("5 parsec", "a number of metres or"), ("1-2", "a number of metres or"),
    ("-1mm", "finite and not negative, got '-1mm'"), ("1e999", "finite and not negative"),
    ("-1e999", "finite and not negative"),
])
def test_what_is_no_length_is_refused_by_its_name(text, words):
    with pytest.raises(InvalidArgument) as raised:
        parse_length(text, "clearance")
    assert str(raised.value).startswith("clearance must be ") and words in str(raised.value)
