"""`split` with error bars: what is printed is what `uncertainty` gives."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.cli.texts.error_bar_text import error_bar_lines
from shapephase.shape_space.shape_path import without_joints

MOMENTUM = ("--momentum", "2", "3", "20")


@pytest.fixture
def take(tmp_path):
    times = np.linspace(0.0, 1.0, 31)
    left, right = 40.0 * np.sin(2.0 * np.pi * times), 30.0 * np.cos(2.0 * np.pi * times)
    rows = [f"{t:.6f},{a:.6f},{b:.6f}" for t, a, b in zip(times, left, right, strict=True)]
    header = "time,left_shoulder_abduction_deg,right_shoulder_abduction_deg"
    file = tmp_path / "take.csv"
    file.write_text("\n".join([header, *rows]))
    return file


def said(capfd, *arguments):
    main([str(argument) for argument in arguments])
    return capfd.readouterr().out


def test_bars_of_a_recording_are_those_of_the_library(capfd, take):
    options = (
        "--joint-noise",
        "0.3deg",
        "--mass-error",
        "0.02",
        "--momentum-error",
        "0.05",
        "--attitude-error",
        "0.01",
    )
    data = json.loads(said(capfd, "split", "diver", take, *MOMENTUM, *options, "--json"))["uncertainty"]
    body = sp.load_body("diver")
    motion = sp.reconstruct(sp.articulated(body, sp.read_shape_path(take, body)), [2.0, 3.0, 20.0])
    expected = sp.uncertainty(
        motion,
        joints=np.radians(0.3),
        inertias=sp.InertiaErrors(masses=0.02),
        momentum=0.05,
        attitude=0.01,
    )
    np.testing.assert_allclose(data["holonomy"], expected.holonomy, rtol=1e-9)
    assert data["montgomery_phase"] == pytest.approx(expected.montgomery_phase, rel=1e-9)
    lines = said(capfd, "split", "diver", take, *MOMENTUM, *options).splitlines()
    (shown,) = (line for line in lines if re.match(r"Montgomery phase.* ± .* deg", line))
    number, bar = map(float, re.search(r"(-?[\d.]+) ± ([\d.]+) deg", shown).groups())
    found = sp.split(motion)
    assert bar == pytest.approx(np.degrees(expected.montgomery_phase), rel=0.05)
    # The number ends where its bar does.
    assert number == pytest.approx(np.degrees(found.montgomery_phase), abs=0.1 * bar + 1e-6)


def test_what_the_errors_do_not_change_says_by_how_little(capfd, take):
    """The start's attitude turns no shape: its lift has no bar, which is not the same as none that can be shown."""
    text = said(capfd, "split", "diver", take, *MOMENTUM, "--attitude-error", "0.01")
    assert re.search(r"shape (lift|holonomy).* deg, which these errors change by less than \de-\d\d\n", text)


@pytest.mark.full
def test_without_what_is_not_known_there_are_no_bars(capfd, take):
    text = said(capfd, "split", "diver", take, *MOMENTUM)
    assert "error bars" not in text
    # The numerical estimate is called what it is.
    assert "± above                 numerical error only" in text
    assert "numerical error only" not in said(capfd, "split", "diver", take, "--joint-noise", "0.1deg")
    assert "numerical error only" not in said(capfd, "split", "cat", "cat_righting")
    assert "uncertainty" not in json.loads(said(capfd, "split", "diver", take, "--json"))


def test_an_angle_of_zero_has_the_bar_of_the_whole_rotation():
    body = sp.load_body("diver")
    path = sp.ShapePath.spline(np.linspace(0.0, 1.0, 9), np.zeros((9, 2)), periodic=False)
    motion = sp.reconstruct(sp.articulated(body, path), np.zeros(3))
    found = sp.split(motion)
    bars = sp.uncertainty(motion, joints=0.01)
    lines = error_bar_lines(found, bars)
    (total,) = (line for line in lines if line.startswith("total rotation"))
    assert float(total.split()[2]) == 0.0
    assert float(total.split()[4]) == pytest.approx(np.degrees(np.sqrt(np.trace(bars.total_rotation))), rel=0.1)
    assert not any("phase" in line for line in lines)


@pytest.mark.parametrize(
    ("wheel", "error", "deviation"),
    [("--rotor wheel_spin=2", "0.05", 0.05), ("--rotor-speed wheel_spin=300rpm", "5rpm", 5.0 * np.pi / 30.0)],
)
def test_bars_of_wheels_are_those_of_the_library(capfd, wheel, error, deviation):
    words = ("split", "satellite", "satellite_sweep", *wheel.split(), "--rotor-error", f"wheel_spin={error}")
    data = json.loads(said(capfd, *words, "--json"))["uncertainty"]
    body = sp.load_body("satellite")
    path = without_joints(sp.examples.MOTIONS["satellite_sweep"].path(), ["wheel_spin"])
    kind = {"rotors": {"wheel_spin": 2.0}} if "speed" not in wheel else {"rotor_speeds": {"wheel_spin": 10.0 * np.pi}}
    expected = sp.uncertainty(
        sp.reconstruct(sp.articulated(body, path, **kind), np.zeros(3)), rotors={"wheel_spin": deviation}
    )
    np.testing.assert_allclose(data["wheel_rotation"], expected.wheel_rotation, rtol=1e-6)
    (line,) = (
        line for line in said(capfd, *words).splitlines() if re.match(r"  stored wheel momentum.* ± .* deg", line)
    )
    bar = float(re.search(r"± ([\d.]+) deg", line).group(1))
    assert bar == pytest.approx(np.degrees(expected.wheel_angle), rel=0.05)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("wheel_spin", "JOINT=VALUE is needed"),
        ("wheel_spin=x", "a momentum in kg m"),
        ("arm_1=0.1", "unknown wheel"),
        ("wheel_spin=-1", "not negative"),
    ],
)
def test_what_is_no_error_of_a_wheel_is_refused(capfd, word, message):
    with pytest.raises(SystemExit):
        main(["split", "satellite", "satellite_sweep", "--rotor", "wheel_spin=2", f"--rotor-error={word}"])
    assert message in capfd.readouterr().err


def test_noise_of_what_was_not_recorded_is_refused(capfd):
    with pytest.raises(SystemExit) as stopped:
        main(["split", "cat", "cat_righting", "--joint-noise", "0.3deg"])
    assert stopped.value.code == 2
    assert "not put through samples" in capfd.readouterr().err


@pytest.mark.parametrize("noise", ["-1", "3 apples", "nan"])
def test_a_noise_that_is_no_amount(capfd, take, noise):
    with pytest.raises(SystemExit) as stopped:
        main(["split", "diver", str(take), f"--joint-noise={noise}"])
    assert stopped.value.code == 4
    assert "joints" in capfd.readouterr().err


@pytest.mark.full
def test_a_smoothed_recording_has_the_bars_of_its_noise_and_says_what_smoothing_did(capfd, take):
    options = ("--smooth", "0.2deg", "--close", "1deg")
    data = json.loads(said(capfd, "split", "diver", take, *MOMENTUM, *options, "--json"))
    body = sp.load_body("diver")
    recorded = sp.read_recorded_motion(take, body, smooth="0.2deg", close="1deg")
    motion = sp.reconstruct(sp.articulated(body, recorded.path), [2.0, 3.0, 20.0])
    expected = sp.uncertainty(motion, joints="0.2deg")
    np.testing.assert_allclose(data["uncertainty"]["holonomy"], expected.holonomy, rtol=1e-9)
    assert data["uncertainty"]["smoothing_bias"] == pytest.approx(expected.smoothing_bias, rel=1e-9)
    told = data["recording"]["smoothing"]
    assert list(told["penalty_s5"]) == list(body.joint_names)
    assert list(told["penalty_s5"].values()) == pytest.approx(recorded.smoothing.penalty.tolist(), rel=1e-12)
    expected_freedom = recorded.smoothing.degrees_of_freedom.tolist()
    assert list(told["degrees_of_freedom"].values()) == pytest.approx(expected_freedom, rel=1e-9)
    assert 0.0 < told["bias_in_bars"] < 1.0
    text = said(capfd, "split", "diver", take, *MOMENTUM, *options, "--joint-noise", "0.1deg")
    for part in ("degrees of freedom are left to a joint", "in the error bars", "smoothing bias"):
        assert part in text
    given = json.loads(said(capfd, "split", "diver", take, *options, "--smooth-penalty", "1e-5", "--json"))
    assert set(given["recording"]["smoothing"]["penalty_s5"].values()) == {1e-5}


@pytest.mark.full
def test_torques_of_a_recording_have_bars_or_say_that_none_are_known(capfd, take):
    data = json.loads(said(capfd, "torques", "diver", take, *MOMENTUM, "--smooth", "0.2deg", "--json"))
    body = sp.load_body("diver")
    path = sp.read_shape_path(take, body, smooth="0.2deg")
    motion = sp.reconstruct(sp.articulated(body, path), [2.0, 3.0, 20.0])
    loads = sp.joint_torques(motion).loads
    bars = sp.torque_errors(sp.joint_torques(motion, loads.peak_time)).torque.diagonal()
    np.testing.assert_allclose(data["standard_deviations"]["peak_torque"], bars, rtol=1e-6)
    text = said(capfd, "torques", "diver", take, *MOMENTUM, "--smooth", "0.2deg")
    for line in text.splitlines():
        if line.startswith(body.joint_names):
            # Peak, per kg, two shares of limits, rate, power and work.
            assert line.count("±") == 7
    assert "± unknown" in said(capfd, "torques", "diver", take, *MOMENTUM)


def test_the_figure_of_a_somersault_has_the_bars_of_the_recording(take, tmp_path, capfd):
    """Those that are stated, and those of the smoothing: the file is that of the library."""
    momentum, body = [2.0, 40.0, 3.0], sp.load_body("diver")
    figure = ("plot", "somersault", "diver", take, "--momentum", "2", "40", "3", "--out", tmp_path / "by_command.svg")
    smoothed = sp.read_recorded_motion(take, body, smooth="0.3deg")
    exact = sp.read_shape_path(take, body)
    for options, path, errors in (
        (("--joint-noise", "0.3deg"), exact, {"joints": "0.3deg"}),
        (("--smooth", "0.3deg"), smoothed.path, {"joints": smoothed.smoothing.noise}),
        ((), exact, {}),
    ):
        said(capfd, *figure, *options)
        motion = sp.reconstruct(sp.articulated(body, path), momentum)
        sp.plots.write_figure("somersault", motion, tmp_path / "by_library.svg", errors=errors)
        texts = [(tmp_path / f"by_{source}.svg").read_text(encoding="utf-8") for source in ("command", "library")]
        # Matplotlib's names of markers and clips are random.
        drawn, expected = (re.sub(r"\b[mp][0-9a-f]{10}\b", "", text) for text in texts)
        assert drawn == expected
    with pytest.raises(SystemExit):
        main(["plot", "phases", *map(str, figure[2:]), "--joint-noise", "0.3deg"])
    assert "error bars" in capfd.readouterr().err
