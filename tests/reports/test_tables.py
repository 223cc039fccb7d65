"""Tables as text: cells of every script, cuts in the middle, widths that just fit, notes and what is left out."""

from __future__ import annotations

import io

import pytest

from collide.reports.tables import (
    Column,
    Table,
    lay_out,
    missing_columns,
    pad,
    printable,
    shorten,
    table_lines,
    width_of,
    wrapped,
    write_text,
)


def text_of(table: Table, width: int, whole_names: bool = False) -> list[str]:
    lines = table_lines(table, lay_out(table, width, whole_names), width)
    return ["".join(text for text, _ in line).rstrip() for line in lines]


@pytest.mark.parametrize(("text", "width"), [
    ("", 0), ("abc", 3), ("é", 1), ("e\u0301", 1), ("日本", 4), ("a\uff21b", 4),
])
def test_cells_of_a_text(text, width):
    assert width_of(text) == width


@pytest.mark.parametrize(("text", "width", "short"), [
    ("abcdefghij", 10, "abcdefghij"), ("abcdefghij", 9, "abcd…ghij"), ("abcdefghij", 6, "abc…ij"),
    ("abcdefghij", 5, "ab…ij"), ("abcdefghij", 2, "a…"), ("abcdefghij", 1, "…"), ("abcdefghij", 0, ""),
    ("日本語の", 8, "日本語の"), ("日本語の", 7, "日…の"), ("日本語の", 5, "日…の"), ("日本語の", 4, "日…"),
])
def test_the_middle_of_a_long_text_is_cut_out(text, width, short):
    assert shorten(text, width) == short


def test_texts_are_filled_at_either_end():
    assert pad("ab", 4) == "ab  " and pad("ab", 4, right=True) == "  ab" and pad("日本", 5) == "日本 "
    assert pad("abc", 2) == "abc"


def test_control_characters_are_written_out():
    assert printable("a b") == "a b" and printable("a\x1b[2J\n") == "a\\x1b[2J\\n"


@pytest.mark.parametrize(("encoding", "text"), [
    ("utf-8", "a → b ≤ 1 µm …"), ("ascii", "a > b <= 1 um ~"), (None, "a → b ≤ 1 µm …"),
])
def test_text_for_a_stream_of_few_letters(encoding, text):
    class Stream(io.StringIO):
        pass

    Stream.encoding = encoding
    stream = Stream()
    write_text("a → b ≤ 1 µm …", stream)
    assert stream.getvalue() == text


def test_a_table_line_by_line():
    """Names and labels to the left, numbers to the right, long text in several lines, no blanks at the end."""
    columns = [Column("body", "name"), Column("depth"), Column("why", "text"), Column("at", "label")]
    rows = [["cup", "1.5", "alpha beta gamma delta", "x"], ["table", "12.25", "", "yy"]]
    table = Table("TITLE  hint", columns, rows, notes=["a note"], more=3)
    assert text_of(table, 80) == [
        "TITLE  hint",
        "  body   depth  why                     at",
        "  ─────  ─────  ──────────────────────  ──",
        "  cup      1.5  alpha beta gamma delta  x",
        "  table  12.25                          yy",
        "  … and 3 more (--all)",
        "  a note",
    ]
    assert text_of(table, 32) == [
        "TITLE  hint",
        "  body   depth  why           at",
        "  ─────  ─────  ────────────  ──",
        "  cup      1.5  alpha beta    x",
        "                gamma delta",
        "  table  12.25                yy",
        "  … and 3 more (--all)",
        "  a note",
    ]
    roles = [[role for _, role in line] for line in table_lines(table, lay_out(table, 80), 80)]
    assert roles == [["title", "note"], ["head"] * 4, ["rule"] * 4, *[["name", "number", "text", "label"]] * 2,
                     ["note"], ["note"]]


def test_a_hint_stands_where_the_whole_title_just_fits():
    table = Table("TITLE  hint", [Column("", "label"), Column("", "label")], [["a", "b"]])
    assert text_of(table, 11) == ["TITLE  hint", "  a  b"] and text_of(table, 10) == ["TITLE", "  a  b"]
    assert text_of(Table("TITLE", table.columns, []), 80) == ["TITLE"]
    with_head = Table("TITLE", [Column("", "label"), Column("n", "label")], [["a", "b"]])
    assert text_of(with_head, 80) == ["TITLE", "     n", "  ─  ─", "  a  b"]


def test_names_are_cut_to_twenty_cells_then_columns_go_then_names_are_cut_to_six():
    columns = [Column("name", "name"), Column("n", "number", 1), Column("m", "number", 2), Column("o", "number")]
    table = Table("T", columns, [["abcdefghijklmnopqrstuvwxyz"[:24], "1234", "123", "1"]])
    cells = lambda width, whole=False: text_of(table, width, whole)[-1].split()
    every = 2 + 24 + 2 + 4 + 2 + 3 + 2 + 1
    assert cells(every) == ["abcdefghijklmnopqrstuvwx", "1234", "123", "1"]
    assert cells(every - 4) == ["abcdefghij…pqrstuvwx", "1234", "123", "1"]
    assert cells(every - 5)[1:] == ["1234", "1"] == cells(every - 9)[1:] and cells(every - 10)[1:] == ["1"]
    assert cells(11) == ["abc…wx", "1"] == cells(3)
    assert cells(every - 1, True) == ["abcdefghijklmnopqrstuvwx", "1234", "1"]
    assert cells(3, True) == ["abcdefghijklmnopqrstuvwx", "1"]
    for width in range(11, every + 2):
        assert max(map(len, text_of(table, width))) <= width


def test_cells_to_spare_go_where_the_most_is_missing():
    columns = [Column("a", "text"), Column("b", "text"), Column("c", "label")]
    table = Table("T", columns, [["x" * 16, "y" * 48, "z"]])
    # the least of a text is 12 cells; with 12 more to spare each column gets its share of what it would take
    least = 2 + 12 + 2 + 12 + 2 + 1
    assert lay_out(table, least).widths == [12, 12, 1] == lay_out(table, 20).widths
    assert lay_out(table, least + 12).widths == [12, 24, 1]
    assert lay_out(table, least + 24).widths == [12, 36, 1] and lay_out(table, least + 28).widths == [13, 39, 1]
    assert lay_out(table, least + 40).widths == [16, 48, 1] == lay_out(table, 200).widths


def test_prose_is_cut_to_the_width_but_not_below_twenty_cells():
    assert wrapped("aaaa bbbb cccc", 20, 2) == ["  aaaa bbbb cccc"] and wrapped("", 40) == [""]
    assert wrapped("aaaa bbbb cccc dddd", 5) == ["aaaa bbbb cccc dddd"]
    assert wrapped("aaaa bbbb cccc dddd eeee", 20, 2, 2) == ["  aaaa bbbb cccc", "    dddd eeee"]
    assert wrapped("a-b" * 9, 20) == ["a-b" * 9]


def test_a_remark_names_the_columns_without_room():
    assert missing_columns([], 80) == []
    assert missing_columns(["one", "two"], 200) == [
        [], [("No room at this width for: one, two. A wider terminal or --json shows them.", "note")],
    ]
