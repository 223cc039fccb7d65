"""The doctor tells what is broken and never raises."""

from __future__ import annotations

from pathlib import Path

import pytest

import collide
from collide.base.cache_folder import TRUST
from collide.reports import doctor
from collide.reports.tables import lay_out, table_lines


def test_a_sound_installation_is_called_sound(tmp_path):
    examination = doctor.examine()
    assert examination.sound and examination.verdict() == "sound"
    lines = ["".join(t for t, _ in line) for table in examination.tables()
             for line in table_lines(table, lay_out(table, 80), 80)]
    assert max(map(len, lines)) <= 80 and any("kernels" in line for line in lines)


@pytest.fixture()
def no_hosts(monkeypatch):
    """Hosts are asked in processes of their own, which takes seconds: `test_a_sound_installation_is_called_sound`."""
    monkeypatch.setattr(doctor, "_hosts", list)


@pytest.mark.usefixtures("no_hosts")
def test_a_wrong_answer_and_a_crash_are_findings(monkeypatch):
    import collide

    def two_pairs():
        sphere = collide.Sphere(0.5)
        yield "wrong", sphere, sphere, 3.0, 1.0
        yield "crash", sphere, None, 3.0, 1.0

    monkeypatch.setattr(doctor, "_known_pairs", two_pairs)
    examination = doctor.examine()
    assert [check.passed for check in examination.answers] == [False, False]
    assert "should hold 1.0" in examination.answers[0].answer
    assert examination.verdict() == "BROKEN: 2 findings: wrong, crash"


@pytest.mark.usefixtures("no_hosts")
def test_how_kernels_run_is_told(monkeypatch):
    from collide.kernels import library, mode

    told = {check.what: check for check in doctor.examine().installed}
    if mode.MODE == mode.COMPILED:
        assert told["kernels"].passed and f"level {library.level} of" in told["kernels"].answer
        assert Path(told["library"].answer) == Path(collide.get_library()) and told["built by"].answer.startswith(
            "numba "
        )
    monkeypatch.setattr(mode, "MODE", mode.JUST_IN_TIME)
    monkeypatch.setattr(mode, "WHY", "this installation was built without compiled kernels")
    monkeypatch.setattr(library, "_built", lambda: None)
    told = {check.what: check for check in doctor.examine().installed}
    assert told["kernels"].passed is None and "NO COMPILED KERNELS" in told["kernels"].answer
    assert mode.WHY in told["kernels"].answer and "library" not in told


@pytest.mark.usefixtures("no_hosts")
def test_a_cache_that_cannot_be_written_is_worth_knowing(monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("a file where a folder should be")
    monkeypatch.setenv("COLLIDE_CACHE_DIR", str(blocked))
    caches = doctor.examine().caches
    assert caches and all(check.passed is None and "COLLIDE_CACHE_DIR" in check.answer for check in caches)


@pytest.mark.usefixtures("no_hosts")
@pytest.mark.skipif(not TRUST, reason="modes of files say nothing here")
def test_a_cache_of_kernels_that_others_may_write_is_worth_knowing(monkeypatch, tmp_path):
    from collide.kernels import mode

    monkeypatch.setattr(mode, "MODE", mode.JUST_IN_TIME)
    monkeypatch.setenv("COLLIDE_CACHE_DIR", str(tmp_path))
    tmp_path.chmod(0o777)
    told, *_ = doctor.examine().caches
    assert told.what == "kernels" and told.passed is None
    assert "code" in told.answer and f"{tmp_path} may be written by others" in told.answer
    tmp_path.chmod(0o700)
    kernels, warning, _ = doctor.examine().caches
    assert kernels.passed and warning.what == "kernels are code"
