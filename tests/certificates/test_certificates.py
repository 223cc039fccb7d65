"""Certificates: made for every pair that has one, checked in integers, and refused when tampered with."""

from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest

import collide
from collide.certificates.certificate import Certificate
from collide.scenes.families import generate, names

LARGE = {"spheres_big", "cyl1000", "bipyramids", "repeats"}


@pytest.mark.many(2)
@pytest.mark.parametrize("family", sorted(set(names()) - LARGE))
def test_every_answer_of_a_family_verifies(family):
    for case in generate(family, 8, 3):
        question = case.shapes()
        collide.verify(*question, collide.distance(*question))


def test_certificates_are_plain_data_and_survive_pickling():
    question = generate("rand_pen", 3, 0)[0].shapes()
    r = collide.distance(*question)
    copied = pickle.loads(pickle.dumps(r.certificate))
    assert copied == r.certificate and all(isinstance(i, int) for one in copied for pair in one.pairs for i in pair)
    collide.verify(*question, r, certificate=copied)


def _tampered(certificate, counts):
    """Every small change of one field of the certificate."""
    kind, a, b, pairs = certificate
    yield Certificate("apart" if kind == "together" else "together", a, b, pairs)
    yield Certificate(kind, a + 1, b, pairs)
    yield Certificate(kind, a, b, ())
    yield Certificate(kind, a, b, ((counts[0], 0),))
    yield Certificate(kind, a, b, ((-1, 0), *pairs))
    for k, (i, j) in enumerate(pairs):
        for other in ((i + 1) % counts[0], j), (i, (j + 1) % counts[1]):
            yield Certificate(kind, a, b, (*pairs[:k], other, *pairs[k + 1 :]))
    if kind == "together":
        for k in range(len(pairs)):
            yield Certificate(kind, a, b, pairs[:k] + pairs[k + 1 :])


@pytest.mark.parametrize("family", ["rand_sep", "rand_pen", "touch_vf", "touch_1ulp", "boxes_flush", "near_sep"])
def test_tampered_certificates_are_refused(family):
    """A changed vertex may still prove the claim where there is room; without room, nearly none may."""
    tried = refused = 0
    for case in generate(family, 12, 9):
        A, B, _X_WA, _X_WB = question = case.shapes()
        r = collide.distance(*question)
        (certificate,) = r.certificate
        counts = len(A.points), len(B.points)
        always = 5
        for k, changed in enumerate(_tampered(certificate, counts)):
            tried += 1
            try:
                collide.verify(*question, r, certificate=(changed,))
            except collide.CertificateRefused as error:
                refused += 1
                assert str(error)
            else:
                assert k >= always, (case.snippet(), changed)
    least = 0.75 if family in ("touch_vf", "touch_1ulp", "boxes_flush") else 0.5
    assert refused >= least * tried, f"{refused} of {tried} refused"


def test_a_certificate_of_another_pose_is_refused():
    box, eye = collide.Box((1, 1, 1)), np.eye(4)
    apart = collide.distance(box, box, eye, collide.pose((1.5, 0, 0)))
    together = collide.distance(box, box, eye, collide.pose((0.5, 0, 0)))
    with pytest.raises(collide.CertificateRefused):
        collide.verify(box, box, eye, collide.pose((0.9, 0, 0)), apart)
    with pytest.raises(collide.CertificateRefused):
        collide.verify(box, box, eye, collide.pose((1.1, 0, 0)), together)


def test_unions_certify_every_pair_of_parts_or_the_one_that_meets():
    two = collide.Compound([(collide.Box((1, 1, 1)), collide.pose((0, 0, 1))), (collide.Sphere(0.5), np.eye(4))])
    ball, eye = collide.Sphere(0.25), np.eye(4)
    apart = collide.distance(two, ball, eye, collide.pose((2, 0, 0)))
    assert len(apart.certificate) == 2
    collide.verify(two, ball, eye, collide.pose((2, 0, 0)), apart)
    with pytest.raises(collide.CertificateRefused, match="pairs of parts"):
        collide.verify(two, ball, eye, collide.pose((2, 0, 0)), apart, certificate=apart.certificate[:1])
    collide.verify(two, ball, eye, eye, collide.distance(two, ball, eye, eye))


def test_what_has_no_certificate_says_so():
    """A region beside a cylinder has none yet."""
    region, cylinder = collide.HPolytope(-np.eye(3), np.zeros(3), bounded=False), collide.Cylinder(1, 1)
    question = region, cylinder, np.eye(4), collide.pose((-3, 0, 0))
    r = collide.distance(*question)
    assert not r.hit and r.certificate is None
    with pytest.raises(collide.InvalidArgument, match="no certificate"):
        collide.verify(*question, r)


def test_verifying_needs_no_kernel():
    """Not of large hulls, either."""
    A = collide.ConvexHull(np.random.default_rng(5).normal(size=(300, 3)))
    eye, X_WB = np.eye(4), collide.pose((9, 0, 0))
    asked = A, A, eye, X_WB, collide.distance(A, A, eye, X_WB)
    code = (
        "import sys, pickle, collide; asked = pickle.load(sys.stdin.buffer); collide.verify(*asked); "
        "bad = [m for m in sys.modules if m.startswith(('numba', 'llvmlite', 'collide.narrowphase', "
        "'collide.kernels'))]; "
        "assert not bad, bad"
    )
    subprocess.run([sys.executable, "-c", code], input=pickle.dumps(asked), check=True)
