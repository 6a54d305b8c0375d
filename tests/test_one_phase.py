"""One phase: the table, JSON, the table in time, the figure and the report all end in the same numbers."""

from __future__ import annotations

import csv
import html
import json
import re

import numpy as np
import pytest

import shapephase as sp
from shapephase import plots, so3, sphere
from shapephase.errors import ShapeError, UnknownNameError
from shapephase.phases.phases import running_phases
from shapephase.phases.split_text import CLOSED_GAP
from support.independent import BODIES, body_of, random_loop, random_vector

# What is computed is the same with and without machine code, which is quicker.

COUNT = 30
NAMES = ("cat_two_halves", "satellite", "cat")
PHASES = {
    "Montgomery phase": "montgomery_phase",
    "dynamic phase": "dynamic_phase",
    "geometric phase": "geometric_phase",
}


def motion_of(number: int) -> sp.Motion:
    name = NAMES[number % len(NAMES)]
    body = body_of(name)
    path = random_loop(number, body.n_shape).path
    momentum = random_vector(number + 50, BODIES[name] * (1 + number % 4))
    return sp.reconstruct(sp.articulated(body, path), momentum)


def gauge_of(number: int) -> str:
    return ("horizontal", "base", "horizontal", "principal")[number % 4]


def digits(text: str) -> list[str]:
    return re.findall(r"[-+−]?\d+\.\d+(?:e[-+]\d+)?", text)


@pytest.mark.parametrize("numbers", [range(k, COUNT, 5) for k in range(5)], ids=str)
def test_the_last_point_in_time_is_the_table(numbers, tmp_path):
    for number in numbers:
        motion, gauge = motion_of(number), gauge_of(number)
        split = sp.split(motion, gauge)
        table = {line[:24].strip(): line for line in str(split).splitlines()}
        data = json.loads(json.dumps(split.to_dict()))
        running = running_phases(motion, np.linspace(0.0, motion.duration, 11), gauge)
        running.write_csv(tmp_path / "phases.csv")
        with open(tmp_path / "phases.csv", newline="") as file:
            *_, last = csv.DictReader(file)
        # Two ways of integrating along one motion, each far nearer to it than the motion is to the truth.
        near = 0.1 * float(motion.error_estimate) + 1e-12
        for row, name in PHASES.items():
            value = float(getattr(split, name))
            assert getattr(running, name)[0] == 0.0
            assert getattr(running, name)[-1] == pytest.approx(value, abs=near)
            assert data[name] == value
            degrees, error, radians = table[row][24:].split()
            assert degrees == f"{np.degrees(value):.6f}"
            assert radians == f"{value:.9f}"
            assert error == f"{data['error_estimates'][name]:.1e}"
            assert float(last[f"{name}_deg"]) == pytest.approx(np.degrees(value), abs=np.degrees(near))
            assert float(last[f"{name}_rad"]) == pytest.approx(value, abs=near)
        assert running.momentum_gap[-1] == pytest.approx(float(split.momentum_gap), abs=near)
        assert running.closing_phase[-1] == pytest.approx(float(split.closing_phase), abs=near)


@pytest.mark.parametrize("number", [0, 1, 2, 3])
def test_the_figure_ends_in_the_table_and_says_what_closes_the_curve(number):
    motion, gauge = motion_of(number), gauge_of(number)
    split = sp.split(motion, gauge)
    ax = plots.plot_phases(plots.column_axes(2.8), motion, gauge)
    legend = ax.get_legend()
    labels = [text.get_text() for text in legend.get_texts()]
    for name, phase in (("dynamic", "dynamic_phase"), ("geometric", "geometric_phase"), ("total", "montgomery_phase")):
        value = float(getattr(split, phase))
        (label,) = [label for label in labels if label.startswith(name)]
        assert label.endswith(f" = {np.degrees(value):.2f}°".replace("-", "−"))
        (line,) = [line for line in ax.lines if line.get_label() == label]
        assert np.asarray(line.get_ydata())[-1] == pytest.approx(value, abs=1e-10)
    title = legend.get_title().get_text()
    assert title.startswith(f"{gauge} gauge")
    gap, added = np.degrees([split.momentum_gap, split.closing_phase])
    assert (f"open by {gap:.2f}°; closing it adds {added:+.2f}°".replace("-", "−") in title) == (gap > 1.0)
    assert [axis.get_ylabel() for axis in (ax, *ax.child_axes[:1])] == ["phase [rad]", "phase [deg]"]


def test_what_closes_an_open_curve_is_said_in_words():
    motion = motion_of(0)
    split = sp.split(motion)
    assert split.momentum_gap > CLOSED_GAP
    said = " ".join(str(split).split())
    gap, added = float(split.momentum_gap), float(split.closing_phase)
    assert f"a great circle of {np.degrees(gap):.4f} deg ({gap:.6f} rad) from its end to its start closes it" in said
    assert f"That adds {np.degrees(added):+.4f} deg ({added:+.6f} rad) to the geometric phase" in said
    top = sp.rigid_body.EulerTop.principal((1.0, 2.0, 3.0), (0.7, 0.2, 1.5))
    closed = sp.split(sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), top.period), [0.7, 0.2, 1.5]), "base")
    assert closed.momentum_gap < 1e-9
    assert abs(closed.closing_phase) < 1e-9
    assert "does not close" not in str(closed)
    assert "by the closing" not in str(closed)


@pytest.mark.parametrize("number", [0, 2, 4, 9])
@pytest.mark.parametrize("gauge", ["base", "horizontal"])
def test_the_closing_is_a_triangle(number, gauge):
    """L'Huilier: of the reference, the end and the start; the rest is what is swept about the reference."""
    motion = motion_of(number)
    split = sp.split(motion, gauge)
    about = running_phases(motion, [0.0, motion.duration], gauge, closing="reference")
    swept = float(about.geometric_phase[-1])
    assert swept + split.closing_phase == pytest.approx(float(split.geometric_phase), abs=1e-10)
    frames = np.eye(3)[None].repeat(2, axis=0)
    if gauge == "horizontal":
        frames = sp.horizontal_gauge(motion.deformation).frame([0.0, motion.duration])
    start, end = np.einsum("nij,nj->ni", frames, motion.body_momentum([0.0, motion.duration]))
    sides = [arc(one, other) for one, other in ((start, end), (end, about.reference), (about.reference, start))]
    half = 0.5 * sum(sides)
    tangents = np.tan(0.5 * half) * np.prod([np.tan(0.5 * (half - side)) for side in sides])
    area = 4.0 * np.arctan(np.sqrt(tangents))
    assert abs(split.closing_phase) == pytest.approx(area, abs=1e-7)


def arc(one, other):
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))


# ---- Jumps ----------------------------------------------------------------------------------------------------------


def tumbling(seed):
    """A frame that turns and swings, from which a rigid body's momentum goes nearly all round the sphere."""
    rng = np.random.default_rng(seed)
    turn, swing = 2.0 * rng.normal(size=3), rng.normal(size=3)
    return lambda t: so3.exp(t[:, None] * turn) @ so3.exp(np.sin(2.0 * t)[:, None] * swing)


@pytest.mark.parametrize(("seed", "jumps"), [(6, -2), (9, 1), (34, -3)])
def test_jumps_are_whole_spheres_and_the_rest_is_continuous(seed, jumps):
    """Against a fan of triangles about the start, whose area does not jump while the curve keeps away from opposite."""
    momentum = np.random.default_rng(seed + 100).normal(size=3)
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 3.0), momentum)
    times = np.linspace(0.0, 3.0, 2001)
    found, split = running_phases(motion, times, tumbling(seed)), sp.split(motion, tumbling(seed))
    assert found.montgomery_phase[-1] == pytest.approx(float(split.montgomery_phase), abs=1e-11)
    assert (found.jumps[0], found.jumps[-1]) == (0, jumps)
    seen = np.einsum("nij,nj->ni", tumbling(seed)(times), motion.body_momentum(times)) / np.linalg.norm(momentum)
    fan = np.concatenate([[0.0], np.cumsum(sphere.triangle_area(seen[:1], seen[:-1], seen[1:]))])
    # Chords leave off what is proportional to the square of their length, over a curve of some ten radians.
    np.testing.assert_allclose(found.solid_angle - 4.0 * np.pi * found.jumps, fan, rtol=0, atol=1e-4)
    whole = np.flatnonzero(np.diff(found.jumps))
    steps = np.abs(np.diff(found.solid_angle))
    assert steps[whole].min() > 3.5 * np.pi
    assert np.delete(steps, whole).max() < 1.0
    assert found.residual < 1e-10
    ax = plots.plot_phases(plots.column_axes(2.8), motion, tumbling(seed))
    assert "by a whole sphere, 720°" in ax.get_legend().get_title().get_text()
    (total,) = [line for line in ax.lines if line.get_label().startswith("total")]
    assert np.isnan(total.get_ydata()).sum() == len(whole)


@pytest.mark.parametrize("above", [0.0, 1e-9, 1e-4, -1e-4])
def test_a_curve_through_the_point_opposite_its_start_ends_in_the_table_too(above):
    def turning(t):
        c, s, zero = np.cos(1.3 * t), np.sin(1.3 * t), 0.0 * t
        return np.stack([c, -s, zero, s, c, zero, zero, zero, zero + 1.0], axis=-1).reshape(-1, 3, 3)

    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.0]), 5.0), [0.0, 1.0, above])
    found, split = running_phases(motion, np.linspace(0.0, 5.0, 100), turning), sp.split(motion, turning)
    assert found.montgomery_phase[-1] == pytest.approx(float(split.montgomery_phase), abs=1e-11)
    rest = np.diff(found.solid_angle - 4.0 * np.pi * found.jumps)
    assert np.abs(rest).max() < 2.0 * np.pi + 0.1


def test_closed_to_a_reference_nothing_jumps():
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 3.0), np.random.default_rng(134).normal(size=3))
    found = running_phases(motion, np.linspace(0.0, 3.0, 500), tumbling(34), closing="reference")
    assert not found.jumps.any()
    assert not found.closing_phase.any()
    assert np.abs(np.diff(found.montgomery_phase)).max() < 1.0
    with pytest.raises(UnknownNameError, match="reference"):
        running_phases(motion, [0.0], closing="end")


def test_tables_in_time_are_of_one_motion(tmp_path):
    deformation = sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0)
    many = running_phases(sp.reconstruct(deformation, np.eye(3)), [0.0, 1.0])
    with pytest.raises(ShapeError, match="motion"):
        many.write_csv(tmp_path / "phases.csv")
    with pytest.raises(ShapeError, match="motion"):
        running_phases(sp.reconstruct(deformation, [1.0, 0.0, 0.0]), 0.5).write_csv(tmp_path / "phases.csv")


def test_the_split_of_a_batch_is_a_table_of_spreads():
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), np.diag([1.0, 2.0, 3.0]))
    split = sp.split(motion)
    lines = str(split).splitlines()
    assert lines[0].endswith("3 motions, a batch (3,)")
    (row,) = [line for line in lines if line.startswith("Montgomery phase")]
    spread = np.degrees([split.montgomery_phase.min(), np.median(split.montgomery_phase), split.montgomery_phase.max()])
    assert row.split()[2:] == [f"{value:.6f}" for value in spread]


# ---- The report -----------------------------------------------------------------------------------------------------


@pytest.mark.full
@pytest.mark.parametrize("number", range(COUNT))
def test_the_report_has_the_numbers_of_the_table(number, tmp_path):
    from shapephase.plots import report

    motion, gauge = motion_of(number), gauge_of(number)
    split = sp.split(motion, gauge)
    report(motion, split).write(tmp_path / "report.html")
    page = re.sub(
        r'srcdoc="[^"]*"|src="data:[^"]*"|<(script|style).*?</\1>',
        "",
        (tmp_path / "report.html").read_text(),
        flags=re.S,
    )
    shown = digits(html.unescape(re.sub(r"<[^>]*>", " ", page)))
    for name in (*PHASES.values(), "momentum_gap"):
        value = float(getattr(split, name))
        assert f"{np.degrees(value):.6f}" in shown, name
        assert f"{value:.9f}" in shown, name
