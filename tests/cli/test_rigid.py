"""`shapephase rigid`: numbers of the free rigid body, by elliptic integrals of another library, and its files."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.special import ellipk

from shapephase.cli.main import main
from shapephase.cli.outcome import ExitCode
from support.pages import page_data

MOMENTS = (1.0, 2.0, 3.0)
MOMENTUM = (0.6, 0.9, 0.5)
TOP = ("rigid", *MOMENTS, "--momentum", *MOMENTUM)


def run(capsys, *words):
    main([str(word) for word in words])
    return capsys.readouterr().out


def test_the_numbers_are_those_of_elliptic_functions(capsys):
    """The period of the momentum, 4 K(k) over the rate of the argument (Landau and Lifshitz, section 37)."""
    data = json.loads(run(capsys, *TOP, "--json"))
    (i1, i2, i3), (x, y, z) = MOMENTS, MOMENTUM
    size, energy = x * x + y * y + z * z, 0.5 * (x * x / i1 + y * y / i2 + z * z / i3)
    # About the axis of the smallest moment: l^2 < 2 E I2.
    assert size < 2.0 * energy * i2
    rate = np.sqrt((i2 - i1) * (2.0 * energy * i3 - size) / (i1 * i2 * i3))
    modulus = (i3 - i2) * (size - 2.0 * energy * i1) / ((i2 - i1) * (2.0 * energy * i3 - size))
    assert data["energy_J"] == pytest.approx(energy, rel=1e-14)
    assert data["period_s"] == pytest.approx(4.0 * ellipk(modulus) / rate, rel=1e-12)
    assert data["regime"] == "circling"
    text = run(capsys, *TOP)
    assert f"{data['period_s']:.6g} s" in text
    assert "Angular momentum" in text
    # Not a number is not JSON.
    assert json.loads(run(capsys, "rigid", 1, 2, 3, "--momentum", 0, 1, 0, "--json"))["period_s"] is None


@pytest.mark.parametrize("figure", ["polhodes", "herpolhode", "rolling", "cones"])
def test_every_figure_is_written(capsys, tmp_path, figure):
    top = ("rigid", 1, 1, 3, "--momentum", *MOMENTUM)
    run(capsys, *top, "--figure", figure, "--time", 0.5, "--out", tmp_path / "figure.svg")
    content = (tmp_path / "figure.svg").read_bytes()
    assert content.startswith(b"<?xml")
    assert 10_000 < len(content) < 300_000


def test_the_page_is_that_of_this_top(capsys, tmp_path):
    run(capsys, *TOP, "--html", tmp_path / "rolling.html")
    data = page_data(tmp_path / "rolling.html")
    assert data["motion"]["momentum"] == list(MOMENTUM)
    assert np.reshape(data["rolling"]["inertia"], (3, 3)) == pytest.approx(np.diag(MOMENTS), abs=1e-14)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("--figure", "orbit", "--out", "a.svg"), ExitCode.USAGE, "Valid: polhodes, herpolhode, rolling, cones"),
        (("--figure", "cones", "--out", "a.svg"), ExitCode.USAGE, "equal"),
        (("--time", "inf", "--out", "a.svg"), ExitCode.USAGE, "--time"),
        (("--out", "a.txt"), ExitCode.USAGE, ".svg or .pdf or .png"),
        (("--video", "a.webm"), ExitCode.USAGE, ".gif or .mp4 or .png"),
    ],
)
def test_what_cannot_be_drawn_is_refused(capsys, tmp_path, monkeypatch, words, code, said):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main([*map(str, TOP), *words])
    assert ended.value.code == code
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_without_momentum_nothing_turns(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["rigid", "1", "2", "3", "--momentum", "0", "0", "0"])
    assert ended.value.code == ExitCode.USAGE
    assert "momentum" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("moments", "largest", "said"),
    [
        ((1, 2, 3), "1e300", "at most 1e+30 kg m^2/s can be drawn"),
        (("1e-20", "1e-20", "1.5e-20"), "1e20", "may turn at 1e+40 rad/s"),
    ],
)
def test_what_turns_too_fast_to_be_drawn_is_refused(capsys, moments, largest, said):
    with pytest.raises(SystemExit) as ended:
        main(["rigid", *map(str, moments), "--momentum", "0", "0", largest])
    assert ended.value.code == ExitCode.USAGE
    assert said in capsys.readouterr().err
