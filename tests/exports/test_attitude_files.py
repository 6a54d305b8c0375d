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
    # With every second record the error is exceeded.
    epochs, packets = kept_records(spice, written)
    thinned = between_records(epochs[::2], packets[::2, [1, 2, 3, 0]], times[times < epochs[::2][-1]])
    inverse = np.swapaxes(motion.attitude(times[: len(thinned)]), 1, 2)
    assert apart(thinned, inverse) > error


def kept_records(spice, written) -> tuple[np.ndarray, np.ndarray]:
    """Epochs [s] and packets (N, 7) of a C-kernel of type 5, whose last word is the number of packets."""
    handle = spice.dafopr(str(written.attitude))
    spice.dafbfs(handle)
    spice.daffna()
    about = spice.dafus(spice.dafgs(5), 2, 6)[1].tolist()
    assert about[:4] == [-999001, 1, 5, 1]
    words = spice.dafgda(handle, about[4], about[5])
    spice.dafcls(handle)
    count = int(words[-1])
    return words[7 * count : 8 * count] * 1e-9, words[: 7 * count].reshape(count, 7)


def between_records(epochs, records, times) -> np.ndarray:
    """Attitudes by SciPy's polynomials of degree 7 through the eight records nearest to sorted times."""
    first = np.clip(np.searchsorted(epochs, times) - 4, 0, len(epochs) - 8)
    found = []
    for begin in np.unique(first):
        window = slice(begin, begin + 8)
        middle, scale = epochs[begin + 4], epochs[begin + 4] - epochs[begin]
        curve = KroghInterpolator((epochs[window] - middle) / scale, records[window])
        found.append(Rotation.from_quat(curve((times[first == begin] - middle) / scale)).as_matrix())
    return np.concatenate(found)


def test_spice_has_attitude_and_rates_at_the_records_and_between(spice, satellite, tmp_path):
    written = sp.exports.write_spice_ck(satellite, tmp_path / "attitude.bc", error=1e-6)
    epochs, packets = kept_records(spice, written)
    assert len(epochs) == written.records
    attitude = satellite.attitude(epochs)
    assert apart(Rotation.from_quat(packets[:, :4], scalar_first=True).inv().as_matrix(), attitude) < 1e-14
    rates = (attitude @ satellite.angular_velocity(epochs)[..., None])[..., 0]
    np.testing.assert_allclose(packets[:, 4:], rates, rtol=0, atol=1e-12)
    for file in (written.clock, written.attitude):
        spice.furnsh(str(file))
    for t in np.random.default_rng(84).uniform(0.0, satellite.duration, 50):
        _, rate, _ = spice.ckgpav(written.instrument, t * 1e9, 0.0, "J2000")
        np.testing.assert_allclose(rate, satellite.attitude(t) @ satellite.angular_velocity(t), rtol=0, atol=1e-4)


@pytest.fixture(scope="module")
def noisy():
    """A minute of joints at 100 Hz with noise of 2 mrad, smoothed for it."""
    body, rng = body_of("satellite"), np.random.default_rng(85)
    times = np.arange(6001) / 100.0
    phases, speeds = rng.uniform(0.0, 6.0, body.n_shape), rng.uniform(0.4, 2.0, body.n_shape)
    samples = 0.3 * np.sin(speeds * times[:, None] + phases) + 2e-3 * rng.normal(size=(len(times), body.n_shape))
    path, _ = sp.shape_space.files.smoothed_path(times, samples, 2e-3, joint_names=body.joint_names)
    return sp.reconstruct(sp.articulated(body, path), [0.5, -0.3, 8.0])


@pytest.mark.full
def test_a_minute_of_a_smoothed_recording_takes_hundreds_of_records(spice, noisy, tmp_path):
    """Records follow the error, however many knots the path has."""
    message = sp.exports.write_aem(noisy, tmp_path / "attitude.aem", error=1e-5)
    written = sp.exports.write_spice_ck(noisy, tmp_path / "attitude.bc", error=1e-5)
    assert message.records == written.records < 2000
    assert sp.exports.write_spice_ck(noisy, tmp_path / "coarse.bc", error=1e-3).records < 0.7 * written.records
    for file in (written.clock, written.attitude):
        spice.furnsh(str(file))
    times = np.sort(np.random.default_rng(86).uniform(0.0, 60.0, 10_000))
    assert apart(np.array([spice.pxform(written.frame, "J2000", t) for t in times]), noisy.attitude(times)) < 1e-5


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
    assert apart(Rotation.from_quat(records.astype(float)).as_matrix(), motion.attitude(epochs)) < 1e-14
    times = np.sort(np.random.default_rng(83).uniform(0.0, motion.duration, 10_000))
    assert apart(between_records(epochs, records.astype(float), times), motion.attitude(times)) < error


def burst():
    """A joint that moves for 0.4 s of 600 s and back, between the first records that are tried."""
    knots, shapes = [0.0, 300.1, 300.3, 300.5, 600.0], np.zeros((5, 3))
    shapes[2, 0] = 1.0
    cat = body_of("cat_two_halves")
    path = sp.ShapePath.waypoints(knots, shapes, joint_names=cat.joint_names)
    return sp.reconstruct(sp.articulated(cat, path), np.zeros(3)), np.linspace(300.0, 300.6, 2000)


def whole_turns():
    """A spin that is back at the first records that are tried, and at quarters between them."""
    spin = 2.0 * np.pi * 64.0 / 10.0
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 10.0), [0.0, 0.0, 2.5 * spin])
    return motion, np.linspace(0.0, 10.0, 2000)


@pytest.mark.parametrize("case", [burst, whole_turns])
def test_records_miss_no_motion_between_the_first_that_are_tried(spice, tmp_path, case):
    motion, times = case()
    written = sp.exports.write_spice_ck(motion, tmp_path / "attitude.bc", error=1e-5)
    for file in (written.clock, written.attitude):
        spice.furnsh(str(file))
    assert apart(np.array([spice.pxform(written.frame, "J2000", t) for t in times]), motion.attitude(times)) < 1e-5


def test_without_an_error_it_is_a_thousandth_of_the_noise_that_joints_were_smoothed_for(satellite, tmp_path):
    """A stored motion keeps that noise."""
    cat, rng, times = body_of("cat_two_halves"), np.random.default_rng(87), np.linspace(0.0, 1.0, 101)
    samples = sp.examples.kane_scher(0.3, 0.5).shape(times) + 4e-3 * rng.normal(size=(101, 3))
    labels = ",".join(["time", *cat.joint_names])
    np.savetxt(tmp_path / "log.csv", np.column_stack([times, samples]), delimiter=",", header=labels, comments="")
    path = sp.read_shape_path(tmp_path / "log.csv", cat, smooth=4e-3)
    motion = sp.reconstruct(sp.articulated(cat, path), [0.0, 0.0, 0.005])
    motion.save(tmp_path / "motion.npz")
    for smoothed in (motion, sp.load_motion(tmp_path / "motion.npz")):
        assert sp.exports.write_aem(smoothed, tmp_path / "attitude.aem").error == pytest.approx(4e-6)
    assert sp.exports.write_aem(satellite, tmp_path / "attitude.aem").error == 1e-8


def test_a_message_in_xml_is_the_one_in_keywords(satellite, tmp_path):
    """Read by ccsds-ndm; names with letters that XML reserves among them."""
    reader = pytest.importorskip("ccsds_ndm.ndm_io")
    segments = []
    for ending in ("aem", "xml"):
        file = tmp_path / f"attitude.{ending}"
        sp.exports.write_aem(satellite, file, error=1e-6, object_name="A&B <1>")
        (segment,) = reader.NdmIo().from_path(file).body.segment
        segments.append(segment)
    assert (tmp_path / "attitude.xml").read_text().startswith("<?xml")
    assert segments[0] == segments[1]
    assert segments[1].metadata.object_name == "A&B <1>"


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
