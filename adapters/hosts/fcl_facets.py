"""Contacts of facets in python-fcl's form: of two meshes, pair by pair, and of one facet with a solid."""

from __future__ import annotations

import numpy as np

from collide.adapters.hosts.facet_contacts import contacts_of_facets, deciding_contact
from collide.adapters.hosts.fcl_geometry import CollisionObject
from collide.adapters.hosts.fcl_requests import Contact
from collide.adapters.hosts.nearest_points import nearest_points


def new_contact(g1, g2, b1: int, b2: int, normal, pos, depth: float) -> Contact:
    """A contact with these fields; those that its constructor would make are not made first."""
    contact = Contact.__new__(Contact)
    contact.__dict__ = {
        "o1": g1, "o2": g2, "b1": b1, "b2": b2, "normal": normal, "pos": pos, "penetration_depth": depth,
    }
    return contact


def facet_contact(o1: CollisionObject, o2: CollisionObject, with_geometry: bool) -> Contact:
    """The contact of a mesh o1 and a mesh or a solid o2 that meet: of those facets that decide that they do, by
    themselves; one of those that `facet_contacts` has.
    """
    g1, g2 = o1._geometry, o2._geometry
    if with_geometry:
        return new_contact(g1, g2, *_of_deciding_facets(g1._shape, g2._shape, o1._X, o2._X, True))
    contact = Contact.__new__(Contact)
    question = g1._shape, g2._shape, o1._X.copy(), o2._X.copy(), False
    contact.__dict__ = {"o1": g1, "o2": g2, "_work": (_of_deciding_facets, question)}
    return contact


def _of_deciding_facets(A, B, X_WA: np.ndarray, X_WB: np.ndarray, with_geometry: bool) -> tuple:
    """The fields `Contact._later` of a mesh and a mesh or a solid."""
    contact = deciding_contact(A, B, X_WA, X_WB, nearest_points(A, B, X_WA, X_WB, signed=False))
    if not with_geometry:
        return contact.facet_a, contact.facet_b, np.zeros(3), np.zeros(3), 0.0
    return contact.facet_a, contact.facet_b, contact.normal, contact.middle, -contact.distance


def facet_contacts(o1: CollisionObject, o2: CollisionObject, limit: int, with_geometry: bool) -> list[Contact]:
    """One for each pair of facets of two meshes that meet."""
    g1, g2 = o1._geometry, o2._geometry
    values = contacts_of_facets(g1._shape, g2._shape, o1._X, o2._X, limit, with_geometry)
    return [new_contact(g1, g2, *of_pair) for of_pair in values]
