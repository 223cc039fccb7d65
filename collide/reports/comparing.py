"""Answers of several engines about a scene, as tables for a terminal.

Reads the plain data of `collide.adapters.peers.compare.Comparison.to_dict` and its table; runs no engine.
"""

from __future__ import annotations

from collide.reports.number_format import brief_length, count, lengths
from collide.reports.tables import Column, Line, Table, lay_out, missing_columns, table_lines, width_of, wrapped

SHORT = 12
#: Reasons told of an engine that was not asked about pairs.
_REASONS = 3
#: Blanks before a column of a table.
_MARGIN = 2


def render(comparison, *, everything: bool = False, width: int = 80, whole_names: bool = False) -> list[Line]:
    """A comparison as lines of (text, role) pieces: the verdict, a column per engine, each dispute.

    comparison : has ``to_dict()``, ``table()`` -> (headers, rows of text) and ``ours_wrong``.
    everything : no list is shortened.   width : cells a line may take.
    whole_names : never shorten a name (for output that goes to a file).
    """
    data = comparison.to_dict()
    style = "colliding" if comparison.ours_wrong else "free"
    lines: list[Line] = [[(line, style)] for line in wrapped(verdict(data), width, hanging=2)]
    headers, rows = comparison.table()
    tables = [*_engine_tables(data, headers, rows, width), *_dispute_tables(data, None if everything else SHORT)]
    dropped: dict[str, None] = {}  # a set that keeps its order
    for table in tables:
        layout = lay_out(table, width, whole_names)
        dropped.update(dict.fromkeys(layout.dropped))
        lines += [[], *table_lines(table, layout, width)]
    return lines + missing_columns(list(dropped), width)


def verdict(data: dict) -> str:
    """The comparison in one line."""
    asked = [summary["engine"] for summary in data["summaries"] if not summary["skipped"]]
    wrong, disputes = data["ours_wrong"], data["disagreements"]
    parts = [
        f"{count(wrong, 'answer')} of {data['reference']} proven wrong" if wrong else
        f"no answer of {data['reference']} proven wrong",
        f"{count(data['pairs'], 'pair')} asked of {', '.join(asked)}",
        *(complaint for summary in data["summaries"][1:] for complaint in [_wrong_of(summary)] if complaint),
    ]
    inside = sum(dispute["kind"] == "inside" for dispute in disputes)
    unjudged = sum(bool(dispute["not_judged"]) for dispute in disputes)
    if not len(disputes) - inside:
        parts.append("no disagreement")
    if unjudged:
        parts.append(f"{count(unjudged, 'disagreement')} not judged")
    if inside:
        parts.append(f"{count(inside, 'answer')} about insides of solids, which others do not see")
    return "; ".join(parts)


def _wrong_of(summary: dict) -> str:
    """What one engine got wrong, in a few words."""
    counts = [
        (summary["wrong"], "wrong boolean"), (summary["wrong_distances"], "wrong distance"),
        (summary["contradictions"], "contradiction"), (len(summary["failed"]), "failure"),
    ]
    parts = [count(n, what) for n, what in counts if n]
    if summary["wrong_distances"]:
        worst = f" ({brief_length(summary['furthest_off']['difference'])} off at worst)"
        parts = [text + worst if "distance" in text else text for text in parts]
    return f"{summary['engine']}: {', '.join(parts)}" if parts else ""


def _engine_tables(data: dict, headers: list[str], rows: list[list[str]], width: int) -> list[Table]:
    """A column per engine: fifteen counts fit below each other, not beside; further tables where lines are full."""
    skipped = {summary["engine"]: summary["skipped"] for summary in data["summaries"] if summary["skipped"]}
    groups: list[list[list[str]]] = [[]]
    free = full = width - _MARGIN - max(map(width_of, headers))
    for row in (row for row in rows if row[0] not in skipped):
        needed = _MARGIN + max(map(width_of, row))
        if groups[-1] and needed > free:
            groups.append([])
            free = full
        groups[-1].append(row)
        free -= needed
    notes = [f"{name} was not asked: {why}" for name, why in skipped.items()]
    notes += [_left_out(summary) for summary in data["summaries"] if summary["unsupported"]]
    tables = []
    for k, group in enumerate(groups):
        columns = [Column(headers[0], "label"), *(Column(row[0]) for row in group)]
        lines = [[header, *(row[i] or "-" for row in group)] for i, header in enumerate(headers) if i]
        title = f"ENGINES  {'more of them' if k else 'counts of pairs'}"
        tables.append(Table(title, columns, lines, notes=notes if group is groups[-1] else []))
    return tables


def _left_out(summary: dict) -> str:
    """Which pairs an engine was not asked about, the commonest reasons first."""
    reasons = sorted(summary["unsupported"].items(), key=lambda item: -item[1])
    listed = [f"{why} ({n})" for why, n in reasons[:_REASONS]]
    listed += [f"{count(len(reasons) - _REASONS, 'other reason')}, in the JSON"] if len(reasons) > _REASONS else []
    pairs = count(sum(summary["unsupported"].values()), "pair")
    return f"{summary['engine']} was not asked about {pairs}: {'; '.join(listed)}"


_TITLES = {
    "hit": "DISAGREEMENTS  does the pair collide?",
    "inside": "INSIDE  one body lies inside the other: engines that see surfaces call it free",
    "distance": "WRONG DISTANCES  off by more than the tolerance, the worst first",
    "contradiction": "CONTRADICTIONS  an engine's boolean against its own distance",
    "left out": "LEFT OUT  a World gave no row where its pair query finds one",
}


def _dispute_tables(data: dict, limit: int | None) -> list[Table]:
    """A table for each kind of dispute, the largest first."""
    kinds = {dispute["kind"]: None for dispute in data["disagreements"]}
    ordered = [kind for kind in _TITLES if kind in kinds] + sorted(set(kinds) - set(_TITLES))
    return [
        _dispute_table(_TITLES.get(kind, kind.upper()), [d for d in data["disagreements"] if d["kind"] == kind],
                       data["reference"], limit)
        for kind in ordered
    ]


def _dispute_table(title: str, disputes: list[dict], reference: str, limit: int | None) -> Table:
    disputes = sorted(disputes, key=lambda d: (not d["wrong"], bool(d["not_judged"]), -_off(d)))
    listed = disputes[:limit]
    ours = _answers([(d["reference_hit"], d["reference_distance"]) for d in listed])
    columns = [
        (Column("engine", "label"), [d["engine"] for d in listed]),
        (Column("body A", "name"), [d["a"] for d in listed]),
        (Column("body B", "name"), [d["b"] for d in listed]),
        (Column("it says"), _answers([(d["hit"], d["distance"]) for d in listed])),
        (Column(f"{reference} says", "number", 1), ours),
        (Column("exact"), _answers([(d["exact_hit"], d["exact_distance"]) for d in listed])),
        (Column("wrong", "text"), [_blame(d) for d in listed]),
    ]
    if listed[0]["kind"] == "distance":
        columns.insert(-1, (Column("off by"), lengths([_off(d) for d in listed])))
    reasons = dict.fromkeys(d["not_judged"].removeprefix("not judged: ") for d in listed if d["not_judged"])
    rows = [list(row) for row in zip(*(cells for _, cells in columns))]
    notes = [f"not judged: {reason}" for reason in reasons]
    if any(d["judged_by"] == "the proven bracket" for d in listed):
        notes.append(f"by bracket: exact arithmetic cannot tell; it is outside the bracket that {reference} proves")
    return Table(title, [column for column, _ in columns], rows, notes=notes, more=len(disputes) - len(listed))


def _off(dispute: dict) -> float:
    """How far the engine's distance was found off, or is from the reference's where that is not known."""
    if dispute["off"] is not None:
        return float(dispute["off"])
    truth = dispute["reference_distance"] if dispute["exact_distance"] is None else dispute["exact_distance"]
    return 0.0 if truth is None or dispute["distance"] is None else abs(dispute["distance"] - truth)


def _answers(answers: list[tuple[bool | None, float | None]]) -> list[str]:
    """Signed distances where there are any, else the boolean."""
    known = iter(lengths([distance for _, distance in answers if distance is not None]))
    words = {True: "collides", False: "free", None: "-"}
    return [words[hit] if distance is None else next(known) for hit, distance in answers]


def _blame(dispute: dict) -> str:
    if dispute["not_judged"]:
        return "not judged"
    names = ", ".join(dispute["wrong"]) or "none"
    remarks = [
        word
        for word, so in (
            ("touching", dispute["touching"]),
            ("by bracket", dispute["judged_by"] == "the proven bracket"),
        )
        if so
    ]
    return f"{names} ({', '.join(remarks)})" if remarks else names
