"""Attitudes of spacecraft, read back by SPICE and by a reader of CCSDS messages: within the error that is stated."""

from __future__ import annotations

import re
from datetime import datetime
from decimal import Decimal
from itertools import product

import numpy as np
import pytest
from scipy.interpolate import KroghInterpolator
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import AccuracyNotReached, MissingExtraError, UnknownNameError
from shapephase.examples import cat_righting
from support.independent import apart, body_of, random_loop
from support.long_runs import full_but

MOMENTUM = [3.0, -1.0, 2.0]


@pytest.fixture(scope="module")
def satellite():
    body = body_of("satellite")
    return sp.reconstruct(sp.articulated(body, random_loop(81, body.n_shape, duration=20.0).path), MOMENTUM)


@pytest.fixture(scope="module")
def cat():
    """It turns at up to 40 rad/s, and the acceleration of its joints jumps."""
    return sp.reconstruct(sp.articulated(body_of("cat"), cat_righting(0.5)), [0.05, 0.0, 0.1])


@pytest.fixture
def spice():
    spiceypy = pytest.importorskip("spiceypy")
    yield spiceypy
    spiceypy.kclear()


@pytest.mark.parametrize(
    ("name", "error"),
    full_but(product(["satellite", "cat"], [1e-6, 1e-9]), ("satellite", 1e-6), ("cat", 1e-6)),
)
def test_spice_has_the_attitude_within_the_stated_error_at_10_000_times(request, spice, tmp_path, name, error):
    """By SPICE's own C-matrices, at its times and between two frames by name."""
    motion = request.getfixturevalue(name)
    written = sp.exports.write_spice_ck(motion, tmp_path / "attitude.bc", error=error)
    for file in (written.clock, written.attitude):
        spice.furnsh(str(file))
    times = np.sort(np.random.default_rng(82).uniform(0.0, motion.duration, 10_000))
    found = np.array([spice.pxform(written.frame, "J2000", t) for t in times])
    assert apart(found, motion.attitude(times)) < error
    # Records are not much denser than the error asks for: with half as many it would be four times as large.
    assert apart(found, motion.attitude(times)) > 0.05 * error


def test_spice_has_attitude_and_rates_at_the_records(spice, satellite, tmp_path):
    written = sp.exports.write_spice_ck(satellite, tmp_path / "attitude.bc", error=1e-6)
    for file in (written.clock, written.attitude):
        spice.furnsh(str(file))
    (handle, segment) = spice.dafopr(str(written.attitude)), None
    spice.dafbfs(handle)
    spice.daffna()
    segment = spice.dafgs(5)
    assert spice.dafus(segment, 2, 6)[1][:4].tolist() == [-999001, 1, 3, 1]
    assert spice.cknr03(handle, segment) == written.records
    for record in range(1, written.records + 1, 50):
        kept = spice.ckgr03(handle, segment, record)
        t = kept[0] * 1e-9
        attitude = satellite.attitude(t)
        assert apart(Rotation.from_quat(kept[1:5], scalar_first=True).inv().as_matrix(), attitude) < 1e-15 * 8
        np.testing.assert_allclose(kept[5:8], attitude @ satellite.angular_velocity(t), rtol=0, atol=1e-12)
    spice.dafcls(handle)


@pytest.mark.full
def test_times_of_spice_far_from_j2000_are_too_coarse_for_a_fast_body(spice, cat, tmp_path):
    """A digit of a time in 2026 is 1.2e-7 s."""
    with pytest.raises(AccuracyNotReached, match=r"1\.2e-07"):
        sp.exports.write_spice_ck(cat, tmp_path / "attitude.bc", error=1e-8, epoch=8.5e8)
    written = sp.exports.write_spice_ck(cat, tmp_path / "attitude.bc", error=1e-4, epoch=8.5e8)
    for file in (written.clock, written.attitude):
        spice.furnsh(str(file))
    times = np.linspace(0.0, cat.duration, 2000)[1:-1]
    found = np.array([spice.pxform(written.frame, "J2000", 8.5e8 + t) for t in times])
    assert apart(found, cat.attitude(times)) < 1e-4


def test_what_spice_has_not_is_refused(satellite, tmp_path, monkeypatch):
    pytest.importorskip("spiceypy")
    for words, said in (
        ({"path": "attitude.ck"}, "ends in .bc"),
        ({"path": "attitude.bc", "reference": "NOWHERE"}, "NOWHERE"),
    ):
        with pytest.raises(UnknownNameError, match=said):
            sp.exports.write_spice_ck(satellite, **{**words, "path": tmp_path / words["path"]}, error=1e-4)
    import sys

    monkeypatch.setitem(sys.modules, "spiceypy", None)
    with pytest.raises(MissingExtraError, match="spiceypy"):
        sp.exports.write_spice_ck(satellite, tmp_path / "attitude.bc")
    assert list(tmp_path.iterdir()) == []


def seconds(text: str) -> Decimal:
    """Of an epoch since J2000's noon."""
    whole, rest = str(text).split(".")
    return Decimal((datetime.fromisoformat(whole) - datetime(2000, 1, 1, 12)).total_seconds()) + Decimal(f"0.{rest}")


@pytest.mark.parametrize(
    ("name", "error"), full_but([("satellite", 1e-7), ("satellite", 1e-9), ("cat", 1e-6)], ("satellite", 1e-7))
)
def test_a_message_has_the_attitude_within_the_stated_error_at_10_000_times(request, tmp_path, name, error):
    """Read by ccsds-ndm, and interpolated by SciPy's polynomials as the message says."""
    reader = pytest.importorskip("ccsds_ndm.ndm_io")
    motion = request.getfixturevalue(name)
    written = sp.exports.write_aem(motion, tmp_path / "attitude.aem", error=error)
    (segment,) = reader.NdmIo().from_path(written.file).body.segment
    about = segment.metadata
    assert (about.interpolation_method, about.interpolation_degree) == ("LAGRANGE", 7)
    states = [state.quaternion_state or state.quaternion_ephemeris for state in segment.data.attitude_state]
    epochs = np.array([float(seconds(state.epoch)) for state in states])
    records = np.array([[getattr(state.quaternion, part) for part in ("q1", "q2", "q3", "qc")] for state in states])
    assert len(records) == written.records
    np.testing.assert_allclose(epochs, np.linspace(0.0, motion.duration, len(epochs)), rtol=0, atol=1e-14)
    assert apart(Rotation.from_quat(records.astype(float)).as_matrix(), motion.attitude(epochs)) < 1e-14
    times = np.sort(np.random.default_rng(83).uniform(0.0, motion.duration, 10_000))
    first = np.clip(np.searchsorted(epochs, times) - 4, 0, len(epochs) - 8)
    worst = 0.0
    for begin in np.unique(first):
        at = times[first == begin]
        window = slice(begin, begin + 8)
        middle, scale = epochs[begin + 4], epochs[begin + 4] - epochs[begin]
        curve = KroghInterpolator((epochs[window] - middle) / scale, records[window].astype(float))
        found = Rotation.from_quat(curve((at - middle) / scale)).as_matrix()
        worst = max(worst, apart(found, motion.attitude(at)))
    assert worst < error


def test_a_message_says_what_it_holds(satellite, tmp_path):
    file = tmp_path / "attitude.aem"
    sp.exports.write_aem(
        satellite, file, error=1e-4, epoch="2026-12-31T23:59:50.25", time_system="TAI", object_name="BUS"
    )
    text = file.read_text()
    for line in ("OBJECT_NAME = BUS", "TIME_SYSTEM = TAI", "ATTITUDE_DIR = A2B", "QUATERNION_TYPE = LAST"):
        assert f"\n{line}\n" in text
    assert "START_TIME = 2026-12-31T23:59:50.250000000000000\n" in text
    assert "STOP_TIME = 2027-01-01T00:00:10.250000000000000\n" in text
    assert len(re.findall(r"^2\S+( -?\d\S*){4}$", text, re.MULTILINE)) > 16
    for words, said in (({"time_system": "UT1"}, "time system"), ({"epoch": "noon"}, "epoch")):
        with pytest.raises(UnknownNameError, match=said):
            sp.exports.write_aem(satellite, file, **words)
