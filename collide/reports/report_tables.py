"""A report as tables: the findings a person has to look at first, the rest folded into lines.

The first page holds verdict, collisions, near pairs, pairs without an answer, and a line each about
contacts, meshes, stand-ins, pairs never tested and notes. ``everything`` gives each of these its table, ``proofs``
adds the proof of every answer.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from collide.reports.number_format import brief_length, coordinates, count, directions, lengths, volume, widths
from collide.reports.pair_classes import Fold, Pair, Pairs
from collide.reports.tables import Column, Table

if TYPE_CHECKING:
    from collide.reports.report import Report

#: Rows shown of each long list, unless all are asked for.
SHORT = 12
#: A body in more pairs of a list than this number has all of them told in a row.
MAX_PAIRS_OF_BODY = 4
_MARK = "≈ "
#: A depth whose bracket is wider than this part of it is told by both ends.
_WIDE = 0.1
#: Bodies named in a line that tells a list.
_NAMED = 3
#: Notes on the first page.
_NOTES = 8


def tables(report: Report, everything: bool, proofs: bool) -> list[Table]:
    """The tables of the page, those with nothing to say left out."""
    shallower = f"SHALLOW  proven less deep than {brief_length(report.query['min_depth'])}, deepest first"
    near = f"NEAR  apart, nearer than {brief_length(report.query['clearance'])}, nearest first"
    all_tables = [
        _pair_table("COLLIDING  deepest first", "colliding", report.colliding, "depth", everything, proofs),
        _pair_table(shallower, "touching", report.shallow, "depth", everything, proofs),
        _pair_table(near, "near", report.near, "distance", everything, proofs),
        _unanswered_table(report),
    ]
    if everything:
        title = "TOUCHING  gap and overlap below rounding"
        all_tables += [
            _pair_table(title, "touching", report.touching, "within", True, proofs),
            _overlap_table(report), _mesh_table(report), _approximation_table(report),
        ]
    all_tables.append(_line_table(report, everything, proofs))
    if proofs:
        all_tables += [_skip_table(report), _proof_table(report)]
    return [table for table in all_tables if table.rows]


def looked_at_first(report: Report) -> list[str]:
    """Lines before all tables, for they limit the verdict: meshes missing or repaired, and notes with a question about
    the input.
    """
    repaired = [entry["body"] for entry in report.approximations if entry["what"].startswith("repaired")]
    lines = [
        *_first_of([f"NOT CHECKED: {entry}" for entry in report.missing_meshes]), *_first_of(report.asks),
    ]
    if repaired:
        named = _and_more(list(dict.fromkeys(repaired))[:_NAMED], len(set(repaired)) > _NAMED)
        lines.append(f"{count(len(set(repaired)), 'mesh', 'meshes')} repaired, answers hold for the repaired: {named}")
    return [f"! {line}" for line in lines]


def _first_of(lines: list[str]) -> list[str]:
    more = f"{len(lines) - _NAMED + 1} more of this kind (--all)"
    return lines if len(lines) <= _NAMED else [*lines[: _NAMED - 1], more]


# --- pairs --------------------------------------------------------------------------------------


def _pair_table(title: str, style: str, pairs: Pairs, measure: str, everything: bool, proofs: bool) -> Table:
    """A class of pairs; ``measure`` says what its number is: depth, distance or within."""
    folds, more = (
        pairs.folded(MAX_PAIRS_OF_BODY, SHORT) if not everything else ([Fold(pair, "", 1) for pair in pairs], 0)
    )
    listed = [fold.pair for fold in folds]
    texts = depth_texts(listed) if measure == "depth" else lengths([_measured(pair, measure) for pair in listed])
    unit, places = coordinates([_place(pair) for pair in listed])
    columns = [
        (Column("body A", "name"), [_marked(pair, pair.a) for pair in listed]),
        (Column("body B", "name"), [_marked(pair, pair.b) for pair in listed]),
        (Column(measure), texts),
        (Column(f"at x y z [{unit}]", "label", 1), places),
        (Column("normal A→B", "label", 2), directions([pair.normal for pair in listed])),
    ]
    if any(fold.size > 1 for fold in folds):
        columns.insert(2, (Column("and", "label"), [f"+{fold.size - 1}" if fold.size > 1 else "" for fold in folds]))
    if measure == "within":
        columns.append((Column("exactly", "label", 3), [_verdict(pair) for pair in listed]))
    elif proofs:
        columns.append((Column("known to", "number", 3), widths([_bracket(pair) for pair in listed])))
    if proofs:
        columns.append((Column("decided by", "label", 4), [pair.how for pair in listed]))
        if any(pair.part_a or pair.part_b for pair in listed):
            columns.append((Column("parts", "label", 5), [f"{pair.part_a}, {pair.part_b}" for pair in listed]))
    rows = [list(cells) for cells in zip(*(cells for _, cells in columns))]
    notes = _fold_notes(folds) + _bracket_notes(listed, measure, everything)
    return Table(title, [column for column, _ in columns], rows, style, notes, more=more)


def _fold_notes(folds: list[Fold]) -> list[str]:
    """What the rows stand for that tell several pairs."""
    folded = [f"{fold.body} with {fold.size - 1} more" for fold in folds if fold.size > 1]
    if not folded:
        return []
    rest = f", … ({len(folded) - _NAMED} more such)" if len(folded) > _NAMED else ""
    return [f"+: also {', '.join(folded[:_NAMED])}{rest} (--all lists them)"]


def _bracket_notes(pairs: list[Pair], measure: str, everything: bool) -> list[str]:
    """A line for each pair whose number is proven less tightly than promised."""
    if measure == "within":
        return []
    wide = [pair for pair in pairs if not pair.certified and not _is_bound(pair) and not _is_range(pair)]
    notes = []
    if any(map(_is_bound, pairs)):
        notes.append("≤: a move that long along the normal parts the bodies, proven; a shorter one may do")
    if any(map(_is_range, pairs)):
        notes.append("…: at least so deep, at most so deep, both proven; ranked by the first")
    notes += [
        f"{pair.a} and {pair.b}: {measure} known to {lengths([_bracket(pair)])[0].strip()} only, wider than promised"
        for pair in wide
    ]
    if not everything and len(notes) > 3:
        notes[3:] = [f"… and {len(notes) - 3} more with a wide bracket (--all)"]
    return notes


def _is_bound(pair: Pair) -> bool:
    """Whether a depth is known as an upper bound only: the depth of bodies that are not convex."""
    return pair.depth is not None and pair.upper == 0.0 and pair.depth > 0.0


def _is_range(pair: Pair) -> bool:
    """Whether a depth is known to lie between two lengths that are far from each other."""
    return (
        pair.depth is not None and not pair.certified and pair.upper is not None and pair.upper < 0.0
        and _bracket(pair) > _WIDE * pair.depth
    )


def depth_texts(pairs: list[Pair]) -> list[str]:
    """How deep pairs are: a length, ``≤ 5 mm`` where no more is known, ``2 mm … 5 mm`` where both ends are proven."""
    least = [-pair.upper for pair in pairs if _is_range(pair) and pair.upper is not None]
    texts = lengths([*(_measured(pair, "depth") for pair in pairs), *least])
    texts, least_texts = texts[: len(pairs)], iter(texts[len(pairs) :])
    for k, pair in enumerate(pairs):
        if _is_bound(pair):
            texts[k] = f"≤ {texts[k]}"
        elif _is_range(pair):
            texts[k] = f"{next(least_texts).split()[0]} … {texts[k].lstrip()}"
    return texts


def _place(pair: Pair) -> list[float]:
    """Where a pair is told to be: the point of A; of a depth that is a bound, the middle of the contact."""
    if not (_is_bound(pair) or _is_range(pair)):
        return pair.point_a
    return [0.5 * (a + b) for a, b in zip(pair.point_a, pair.point_b)]


def _verdict(pair: Pair) -> str:
    """What exact arithmetic says of a pair that rounding cannot tell."""
    if not pair.decided:
        return "open"
    return "meet" if pair.depth is not None else "apart"


def _marked(pair: Pair, name: str) -> str:
    return _MARK + name if name in pair.approximated else name


def _measured(pair: Pair, measure: str) -> float:
    if measure == "within":
        return max(abs(_or_infinite(pair.lower)), abs(_or_infinite(pair.upper)))
    return _or_infinite(pair.depth if measure == "depth" else pair.distance)


def _or_infinite(value: float | None) -> float:
    return math.inf if value is None else value


def _bracket(pair: Pair) -> float:
    return _or_infinite(pair.upper) - pair.lower if pair.lower is not None else math.inf


# --- lists told in a line ------------------------------------------------------------------------


def _line_table(report: Report, everything: bool, proofs: bool) -> Table:
    """What a person should know of, a line each; what has a table of its own is left out."""
    lines = [] if everything else [
        ("touching", _touching_line(report)), ("overlaps", _overlap_line(report)), ("meshes", _mesh_line(report)),
        ("stand-ins", _approximation_line(report)),
    ]
    lines += [] if proofs else [("never tested", _skip_line(report))]
    lines += [] if everything else _note_lines(report)
    title = "BESIDES" if everything else "BESIDES  --all lists them, --proofs tells how each answer is known"
    return Table(title, [Column("", "label"), Column("", "text")], [list(line) for line in lines if line[1]])


def _touching_line(report: Report) -> str:
    pairs = report.touching
    if not len(pairs):
        return ""
    within = lengths([pairs.largest()])[0].strip()
    bodies = pairs.busiest() if len(pairs) > _NAMED else []
    often = [f"{n} with {name}" for name, n in bodies[:_NAMED] if n > 1]
    named = [f"{pair.a} and {pair.b}" for pair in pairs[:_NAMED]] if not often else often
    return f"{count(len(pairs), 'pair')}, gap or overlap at most {within}: {_and_more(named, len(pairs) > _NAMED)}"


def _and_more(named: list[str], more: bool) -> str:
    return ", ".join(named) + (", …" if more else "")


def _overlap_line(report: Report) -> str:
    entries = [entry for entry in report.overlaps if entry["volume"] > 0.0]
    if not entries:
        return ""
    entries.sort(key=lambda entry: -entry["volume"])
    named = [f"{volume(entry['volume'])} of {entry['a']} and {entry['b']}" for entry in entries[:_NAMED]]
    return f"{count(len(entries), 'pair')} of solids with a volume in common: {_and_more(named, len(entries) > _NAMED)}"


def _mesh_line(report: Report) -> str:
    surfaces = [entry for entry in report.meshes if not entry["solid"]]
    if not report.meshes:
        return ""
    what = f"{len(report.meshes)} as they are, triangle by triangle"
    if not surfaces:
        return f"{what}; all are solid"
    if len(surfaces) == 1:
        return f"{what}; {surfaces[0]['body']} is a {surfaces[0]['what']}"
    bodies = list(dict.fromkeys(entry["body"] for entry in surfaces))
    return f"{what}; {len(surfaces)} have no inside, a surface only: {_and_more(bodies[:_NAMED], len(bodies) > _NAMED)}"


def _approximation_line(report: Report) -> str:
    entries = report.approximations
    if not entries:
        return ""
    named = [f"{entry['body']} ({entry['what']})" for entry in entries[:2]]
    return (
        f"{_MARK.strip()} {count(len(entries), 'body', 'bodies')}, answers hold for these: "
        f"{_and_more(named, len(entries) > 2)}"
    )


def _skip_line(report: Report) -> str:
    reasons = [f"{entry['pairs']} {entry['reason']}" for entry in report.skipped]
    if not reasons:
        return ""
    return f"{report.pairs['excluded']} of {count(report.pairs['total'], 'pair')}: {', '.join(reasons)}"


def _note_lines(report: Report) -> list[tuple[str, str]]:
    """A line for each note; those of `looked_at_first` stand above."""
    ahead = {*report.missing_meshes, *report.asks}
    notes = [note for note in dict.fromkeys(report.notes) if note not in ahead]
    lines = notes if len(notes) <= _NOTES else [*notes[: _NOTES - 1], f"… and {len(notes) - _NOTES + 1} more (--all)"]
    return [("notes" if k == 0 else "", line) for k, line in enumerate(lines)]


# --- lists in full -------------------------------------------------------------------------------


def _approximation_table(report: Report) -> Table:
    return Table(
        f"APPROXIMATED  marked {_MARK.strip()} above: answers hold for what stands in",
        [Column("body", "name"), Column("stands in", "text")],
        [[entry["body"], entry["what"]] for entry in report.approximations],
    )


def _mesh_table(report: Report) -> Table:
    """Surfaces before solids: what has no inside is what a reader has to know."""
    return Table(
        "MESHES  as they are, triangle by triangle",
        [Column("body", "name"), Column("taken as", "text")],
        [[entry["body"], entry["what"]] for entry in sorted(report.meshes, key=lambda entry: entry["solid"])],
    )


def _overlap_table(report: Report) -> Table:
    unit, at = coordinates([entry["centroid"] for entry in report.overlaps])
    columns = [Column("body A", "name"), Column("body B", "name"), Column("volume")]
    return Table(
        "OVERLAPS  what colliding solids have in common", [*columns, Column(f"centroid x y z [{unit}]", "label")],
        [[entry["a"], entry["b"], volume(entry["volume"]), place] for entry, place in zip(report.overlaps, at)],
    )


def _unanswered_table(report: Report) -> Table:
    return Table(
        "NOT ANSWERED  near each other; whether they collide is not known",
        [Column("body A", "name"), Column("body B", "name"), Column("because", "text")],
        [[entry["a"], entry["b"], entry["why"]] for entry in report.unanswered],
        "colliding",
    )


def _skip_table(report: Report) -> Table:
    return Table(
        "NEVER TESTED  nothing is claimed about these pairs",
        [Column("pairs"), Column("why", "text")],
        [
            [str(entry["pairs"]), entry["reason"] + (f": {entry['meaning']}" if entry["meaning"] else "")]
            for entry in report.skipped
        ],
    )


def _proof_table(report: Report) -> Table:
    return Table(
        "HOW EACH ANSWER IS KNOWN",
        [Column("pairs"), Column("argument", "label"), Column("because", "text")],
        [[str(entry["pairs"]), entry["how"], entry["sentence"]] for entry in report.proofs],
    )
