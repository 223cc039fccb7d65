"""Spheres of a robot's links, made, and spheres or other convex pieces, audited, as tables, words and JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from collide.reports.number_format import brief_length, count, lengths
from collide.reports.tables import Column, Table

if TYPE_CHECKING:
    from collide.spheres.enclosing_spheres import EnclosingSpheres
    from collide.spheres.facets_outside import PieceAudit

SCHEMA = "collide-spheres/1"


class MadeLink(NamedTuple):
    """Spheres made around a link.   link : its name.   spheres : in the frame of the link."""

    link: str
    spheres: EnclosingSpheres


class AuditedLink(NamedTuple):
    """A link beside published spheres, or other convex pieces.

    link : its name.   n_spheres, n_pieces : of the link, spheres among the pieces.   audit : ``None`` for a link
    without pieces.
    """

    link: str
    n_spheres: int
    n_pieces: int
    audit: PieceAudit | None

    @property
    def encloses(self) -> bool:
        return self.audit is not None and self.audit.encloses


# --- made ---------------------------------------------------------------------------------------


def made_table(links: list[MadeLink]) -> Table:
    """A row a link."""
    columns = [Column("link", "name"), Column("spheres"), Column("exceed it by ≤"), Column("and ≥", optional=1),
               Column("radii", optional=2), Column("proven", "label")]
    lower, upper = (lengths([link.spheres.excess[k] for link in links]) for k in (0, 1))
    rows = []
    for (link, spheres), low, high in zip(links, lower, upper):
        radii = f"{1e3 * spheres.radii.min():.3g} – {1e3 * spheres.radii.max():.3g} mm"
        rows.append([link, str(len(spheres.radii)), high, low if spheres.excess[0] > 0.0 else "", radii, "yes"])
    notes = [
        "exceed it by: the greatest distance of a point of the spheres from the link, between proven bounds.",
        "proven: the spheres contain the link's collision geometry; the certificate was checked in integers.",
    ]
    return Table("SPHERES", columns, rows, notes=notes)


def made_words(robot: str, links: list[MadeLink]) -> str:
    total = sum(len(link.spheres.radii) for link in links)
    worst = max(links, key=lambda link: link.spheres.excess[1])
    return (
        f"{robot}: {count(total, 'sphere')} contain {count(len(links), 'link')}, proven; at most "
        f"{_brief(worst.spheres.excess[1])} beyond them ({worst.link})"
    )


def made_items(robot: str, links: list[MadeLink]) -> dict[str, Any]:
    return {
        "schema": SCHEMA, "robot": robot, "links": [
            {
                "link": link.link, "centers": link.spheres.centers.tolist(), "radii": link.spheres.radii.tolist(),
                "excess": list(link.spheres.excess), "proven": True,
            }
            for link in links
        ],
    }


# --- audited ------------------------------------------------------------------------------------


def audited_kind(links: list[AuditedLink]) -> str:
    """What pieces are called: spheres, if all are, or pieces."""
    return "spheres" if all(link.n_spheres == link.n_pieces for link in links) else "pieces"


def audit_table(links: list[AuditedLink], place: str) -> Table:
    kind = audited_kind(links)
    columns = [Column("link", "name"), Column(kind), Column("surface outside"), Column("up to"),
               Column("exceed it by", optional=1)]
    with_pieces = [link for link in links if link.audit is not None]
    out = iter(lengths([_outside(link)[1] for link in with_pieces]))
    beyond = iter(lengths([_audit(link).excess[1] for link in with_pieces]))
    rows = []
    for link in links:
        if link.audit is None:
            rows.append([link.link, "0", "100 %", f"no {kind}", ""])
        else:
            reach, excess = next(out), next(beyond)
            rows.append([link.link, str(link.n_pieces), *_outside_words(link.audit, reach), excess])
    notes = [
        "surface outside, up to: its share of the link's surface, and the greatest distance; no more, proven.",
        f"exceed it by: no point of the {kind} is farther from the link. --json has both bounds of every number.",
    ]
    return Table(f"{kind.upper()} OF {place}", columns, rows, notes=notes)


def _outside_words(audit: PieceAudit, reach: str) -> list[str]:
    if audit.encloses:
        return ["none, proven", ""]
    if len(audit.holes):
        return ["holes inside", ""]
    if audit.outside[1] == 0.0:
        return ["none; inside open", ""]
    low, high = (100.0 * x for x in audit.share)
    share = f"{high:.2g} %" if high < 1.0 else f"{low:.0f} %" if f"{low:.0f}" == f"{high:.0f}" else (
        f"{low:.0f} – {high:.0f} %"
    )
    return [share, reach]


def audit_words(robot: str, place: str, links: list[AuditedLink]) -> str:
    outside = [link for link in links if not link.encloses]
    if not outside:
        return f"{place} contains the collision geometry of {robot}: {count(len(links), 'link')}, proven"
    measured = [link for link in outside if link.audit is not None]
    text = f"{place} does not contain {robot}: {len(outside)} of {count(len(links), 'link')} lie outside in part"
    if measured:
        worst = max(measured, key=lambda link: _outside(link)[0])
        text += f", by {_brief(_outside(worst)[0])} at most ({worst.link})"
    bare = len(outside) - len(measured)
    return text + (f"; {count(bare, 'link')} without {audited_kind(links)}" if bare else "")


def link_words(link: AuditedLink) -> str:
    """What a page says of a link."""
    kind = audited_kind([link]).removesuffix("s")
    if link.audit is None:
        return "the link has no pieces: all of it is outside"
    if link.encloses:
        return f"inside its {count(link.n_pieces, kind)}, proven"
    share, reach = _outside_words(link.audit, _brief(link.audit.outside[1]))
    what = f"{share} of the surface, up to {reach}" if reach else share
    return f"outside its {count(link.n_pieces, kind)}: {what}"


def audit_items(robot: str, place: str, links: list[AuditedLink]) -> dict[str, Any]:
    return {
        "schema": SCHEMA, "robot": robot, "audited": place, "encloses": all(link.encloses for link in links),
        "links": [_audit_item(link) for link in links],
    }


def _audit_item(link: AuditedLink) -> dict[str, Any]:
    item: dict[str, Any] = {
        "link": link.link, "spheres": link.n_spheres, "pieces": link.n_pieces, "encloses": link.encloses,
    }
    if link.audit is not None:
        audit = link.audit
        item |= {
            "outside": list(audit.outside), "share_outside": list(audit.share), "area": audit.area,
            "farthest": audit.farthest.tolist() if audit.outside[1] > 0.0 else None, "excess": list(audit.excess),
            "holes": audit.holes.tolist(),
        }
    return item


def _audit(link: AuditedLink) -> PieceAudit:
    assert link.audit is not None
    return link.audit


def _outside(link: AuditedLink) -> tuple[float, float]:
    return _audit(link).outside


def _brief(metres: float) -> str:
    return brief_length(float(f"{metres:.3g}"))
