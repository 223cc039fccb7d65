"""Verifying: forms that are read, questions that are refused, and every pair of parts that must be certified."""

from __future__ import annotations

import numpy as np
import pytest
from naive import pose

import collide
from collide.certificates.certificate import Certificate, CertificateRefused, read_certificates
from collide.certificates.verify import check_question

EYE = np.eye(4)
TWO = collide.Compound([(collide.Sphere(0.5), pose(t=(x, 0, 0))) for x in (-1, 1)])
BOX = collide.Box((1, 1, 1))


def test_forms_of_certificates():
    read = read_certificates([["apart", 0, np.int64(1), [[2, 3], (4, 5)]]])
    assert read == [Certificate("apart", 0, 1, ((2, 3), (4, 5)))] and type(read[0].part_b) is int
    for bad in (7, [7], ["apart"], [("apart", 0, 0)], [("apart", 0.5, 0, [])], [("apart", 0, 0, [(1, 2, 3)])],
                [("apart", 0, 0, [("1", 2)])]):
        with pytest.raises(CertificateRefused, match="rows of"):
            read_certificates(bad)


def test_questions_that_are_none():
    r = collide.distance(BOX, BOX, EYE, pose(t=(3, 0, 0)))
    check_question("verify", [BOX], [TWO], r)
    with pytest.raises(collide.InvalidArgument, match="verify: B must be a shape"):
        check_question("verify", [BOX], [BOX, 3], r)
    with pytest.raises(collide.InvalidArgument, match="r must be a result"):
        check_question("verify", [BOX], [BOX], True)
    batch = collide.distance(BOX, BOX, EYE, np.stack([pose(t=(3, 0, 0))] * 2))
    with pytest.raises(collide.InvalidArgument, match="must be one pose each and r one result"):
        collide.verify(BOX, BOX, EYE, np.stack([pose(t=(3, 0, 0))] * 2), batch)


def test_every_pair_of_parts_must_be_apart():
    X_WB = pose(t=(0, 3, 0))
    r = collide.distance(TWO, BOX, EYE, X_WB)
    given = r.certificate
    assert not r.hit and len(given) == 2
    collide.verify(TWO, BOX, EYE, X_WB, r)
    for tampered, words in (
        (given[:1], "2 pairs of parts, 1"), ((given[0], given[0]), "2 pairs of parts, 1"), ((), "2 pairs of parts, 0"),
        ((given[0], given[1]._replace(part_a=2)), "no parts 2 and 0"),
        ((given[0], given[1]._replace(kind="together")), "says apart, the certificate 'together'"),
    ):
        with pytest.raises(CertificateRefused, match=words):
            collide.verify(TWO, BOX, EYE, X_WB, r, certificate=tampered)


def test_one_pair_that_meets_is_enough():
    X_WB = pose(t=(1.5, 0, 0))
    r = collide.distance(TWO, BOX, EYE, X_WB)
    assert r.hit and len(r.certificate) == 1 and r.certificate[0].part_a == 1
    collide.verify(TWO, BOX, EYE, X_WB, r)
    with pytest.raises(CertificateRefused, match="parts 0 and 0"):
        collide.verify(TWO, BOX, EYE, X_WB, r, certificate=(r.certificate[0]._replace(part_a=0),))
