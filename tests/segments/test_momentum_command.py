"""`shapephase momentum`, and somersaults and momenta among the samples of `split`."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import TrajectoryWarning, UnknownNameError

FALL = {"start": [0.0, 0.0, 2.0], "velocity": [0.5, 0.0, 9.81], "gravity": [0.0, 0.0, -9.81]}


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    file = tmp_path_factory.mktemp("take") / "cat.csv"
    motion = sp.reconstruct(
        sp.articulated(sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)), [0.001, 0.002, 0.005]
    )
    sp.export_motion(motion, file, np.linspace(0.0, 1.0, 61), **FALL)
    return file


def test_a_recording_is_taken_as_recorded_unless_its_fit_or_a_momentum_is_requested(take, tmp_path, capsys):
    main(["momentum", "cat_two_halves", str(take), "--json", "--out", str(tmp_path / "m.csv")])
    data = json.loads(capsys.readouterr().out)
    assert data["as_recorded"]
    (flight,) = data["flights"]
    assert not flight["more_than_noise"]
    np.testing.assert_allclose(flight["mean"], [0.001, 0.002, 0.005], rtol=0, atol=1e-6)
    table = np.genfromtxt(tmp_path / "m.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["momentum_z_kg_m2_s"], 0.005, rtol=0, atol=1e-5)
    main(["momentum", "cat_two_halves", str(take), "--fitted", "--json"])
    fitted = json.loads(capsys.readouterr().out)
    assert not fitted["as_recorded"]
    np.testing.assert_allclose(fitted["flights"][0]["mean"], [0.001, 0.002, 0.005], rtol=0, atol=1e-6)
    main(["momentum", "cat_two_halves", str(take), "--momentum", "0", "0", "0.01", "--json"])
    given = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(given["flights"][0]["mean"], [0.0, 0.0, 0.01], rtol=0, atol=1e-12)


def test_axes_and_divisors_are_printed_with_their_numbers(take, tmp_path, capsys):
    options = ["--axes", "0,0,-1", "--normalise", "gravity", "--stature", "0.5"]
    main(["momentum", "cat_two_halves", str(take), *options, "--figure", str(tmp_path / "m.svg")])
    text = capsys.readouterr().out
    assert "divided by m h sqrt(g h)" in text
    assert "h = 0.5 m (given)" in text
    assert "within noise" in text
    assert "front" in text
    assert b"<svg" in (tmp_path / "m.svg").read_bytes()


def test_link_momenta_go_into_the_samples(tmp_path, capsys):
    words = ["split", "diver", "diver_twist", "--momentum", "0", "61.558831", "0"]
    main([*words, "--samples", str(tmp_path / "d.csv"), "--link-momenta"])
    table = np.genfromtxt(tmp_path / "d.csv", delimiter=",", names=True)
    total = sum(table[f"{link}_momentum_y_kg_m2_s"] for link in ("trunk", "left_arm", "right_arm"))
    np.testing.assert_allclose(total, 61.558831, rtol=1e-12)
    np.testing.assert_allclose(np.ptp(table["somersault_rad"]) / (2.0 * np.pi), 1.5, rtol=0, atol=1e-4)
    with pytest.raises(SystemExit):
        main([*words, "--link-momenta"])
    assert "--samples" in capsys.readouterr().err


def test_the_figure_stacks_limbs_up_to_the_whole():
    cat = sp.load_body("cat")
    motion = sp.reconstruct(sp.articulated(cat, sp.examples.cat_righting()), [0.01, 0.02, -0.05])
    found = sp.segment_momentum(motion)
    ax = sp.plots.plot_segment_momentum(sp.plots.column_axes(3.4), found)
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == [*found.by_limb(), "whole"]
    # Along z, where it is largest: areas above zero and below it add up to the whole.
    np.testing.assert_allclose(ax.lines[0].get_ydata(), -0.05, rtol=1e-12)
    heights = [area.get_paths()[0].vertices[:, 1] for area in ax.collections]
    low, high = min(y.min() for y in heights), max(y.max() for y in heights)
    parts = np.array(list(found.by_limb().values()))[..., 2]
    np.testing.assert_allclose(low, np.minimum(parts, 0.0).sum(axis=0).min(), rtol=1e-12)
    np.testing.assert_allclose(high, np.maximum(parts, 0.0).sum(axis=0).max(), rtol=1e-12)
    with pytest.raises(UnknownNameError, match="along"):
        sp.plots.plot_segment_momentum(sp.plots.column_axes(3.4), sp.segment_momentum(motion, axes=[0, 1, 0]), "z")


def test_after_a_low_pass_filter_the_noise_of_the_base_has_to_be_stated(take):
    body = sp.load_body("cat_two_halves")
    recorded = sp.read_recorded_motion(take, body, lowpass=10.0)
    with pytest.warns(TrajectoryWarning, match="--attitude-noise"):
        short = sp.segment_momentum(recorded, body)
    stated = sp.segment_momentum(recorded, body, attitude_noise=0.01)
    assert np.all(stated.whole_bars > short.whole_bars)


def test_a_motion_without_a_recorded_base_states_the_momentum_that_is_taken(capsys):
    main(["momentum", "diver", "diver_twist", "--momentum", "0", "61.558831", "0", "--axes", "0,1,0"])
    text = capsys.readouterr().out
    assert "momentum (0 61.5588 0) kg m^2/s" in text.splitlines()[0]
    assert "along the given axis" in text


@pytest.mark.parametrize(
    ("words", "name"),
    [(["--joint-noise", "0.3deg"], "joint_noise"), (["--stature", "1.7"], "stature"), (["--speed", "1"], "speed")],
)
def test_options_without_effect_are_refused(words, name, capsys):
    with pytest.raises(SystemExit):
        main(["momentum", "diver", "diver_twist", *words])
    assert re.search(rf"{name} \(.*\): without effect here; leave it out", capsys.readouterr().err)
