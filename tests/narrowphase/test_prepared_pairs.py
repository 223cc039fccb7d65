"""Pairs of shapes that are kept with A: found by both, forgotten with B, and no more of them than a shape may have."""

from __future__ import annotations

import gc
import weakref

import collide
from collide.narrowphase import prepared_pairs as P


class Pair:
    """Whatever is kept; weakly referable."""


def test_pairs_are_kept_by_both_shapes():
    A, B, C = collide.Sphere(1.0), collide.Sphere(1.0), collide.Sphere(1.0)
    assert P.prepared_pair(A, B) is None
    first, second = Pair(), Pair()
    P.keep_prepared(A, B, first)
    P.keep_prepared(A, C, second)
    P.keep_prepared(C, C, second)
    assert P.prepared_pair(A, B) is first and P.prepared_pair(A, C) is P.prepared_pair(C, C) is second
    assert P.prepared_pair(B, A) is None, "another order is another pair"
    P.keep_prepared(A, B, second)
    assert P.prepared_pair(A, B) is second


def test_a_partner_that_is_gone_is_not_held():
    A, B = collide.Sphere(1.0), collide.Box((1, 1, 1))
    pair = Pair()
    P.keep_prepared(A, B, pair)
    kept, gone = weakref.ref(pair), weakref.ref(B)
    del pair, B
    gc.collect()
    assert gone() is None and kept() is None and not A._prepared


def test_the_oldest_partners_go():
    A = collide.Sphere(1.0)
    partners = [collide.Sphere(1.0) for _ in range(P._MAX_PARTNERS + 3)]
    for k, B in enumerate(partners):
        P.keep_prepared(A, B, k)
    assert [P.prepared_pair(A, B) for B in partners[:4]] == [None, None, None, 3]
    assert P.prepared_pair(A, partners[-1]) == len(partners) - 1 and len(A._prepared) == P._MAX_PARTNERS
