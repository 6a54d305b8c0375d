"""Figures in time: phases, attitude, energy, torques, and the deformation behind them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_choice, check_object, names_argument
from ..arrays import Array, Integers
from ..bounds.energy import energy_along
from ..deformation.deformation import Deformation
from ..dynamics.torques import joint_torques
from ..errors import ShapeError
from ..phases.momentum_curve import Gauge
from ..phases.phases import RunningPhases, running_phases
from ..phases.split_text import CLOSED_GAP
from ..reconstruction.reconstruction import Motion
from . import plot_style as style
from ._joint_styles import MAX_NAMED, joint_place, plain_text, plot_joints

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..bounds.regimes import RegimeCertificate

ATTITUDES = ("rotation_vector", "quaternion")
INERTIAS = ("principal", "entries")
_ENTRIES = ((0, 0, "xx"), (1, 1, "yy"), (2, 2, "zz"), (0, 1, "xy"), (1, 2, "yz"), (0, 2, "xz"))
_TOTAL: dict[str, Any] = {"color": style.BLACK, "linestyle": (0, (4, 1.5)), "linewidth": 1.6}
_JUMPED: dict[str, Any] = {"color": style.GREY, "linestyle": (0, (1, 1.5)), "linewidth": 1.2, "zorder": 1.4}
_JUMP = 1.0  # [rad, or 1 for a quaternion] between neighbouring points: a jump, no curve
_HALF_TURN = 1e-6  # [rad] short of a half turn that counts as one
_FLAT = 0.06  # of the other phases' range: a geometric phase within it seems flat
_NOTHING = 1e-9  # [rad] rounding
_PRESSED = 0.3  # least share of the axis for the energy and its two nearest curves
_NO_BAND = 1e-9  # of the energy: a narrower band is rounding, as between equal moments
_ROOM = 0.05  # of the range of the energies, beyond its ends
# Energies that bound the regimes, as the legend names them.
_LEAST = r"$\ell^2\!/2I_1$"
_SEPARATRIX = r"$\ell^2\!/2I_2$, separatrix"
_MOST = r"$\ell^2\!/2I_3$"
_IDLE = 1e-9  # of the largest torque or force: a joint that does nothing
_TORQUE_UNITS = {"rad": "N m", "m": "N"}
_TORQUE_LABELS = {"rad": "torques [N m]", "m": "forces [N]"}


def plot_phases(
    ax: Axes,
    motion: Motion,
    gauge: Gauge = "horizontal",
    *,
    times: ArrayLike | None = None,
    closing: str = "start",
) -> Axes:
    """The dynamic, geometric and total (Montgomery) phase in time, in degrees and in radians.

    Each ends in the number of `split`, which the legend has: at every time the momentum's curve so far is closed by
    the great circle back to its start. Where it stays open by more than a degree, the legend has what the circle
    adds at the end. Where the great circle passes over the region that is not counted, the lines jump by a whole
    sphere, 720 degrees, which dots mark. A geometric phase too small to be seen beside the others is enlarged in an
    inset, in degrees.

    Parameters
    ----------
    ax : flat axes
    motion : of one momentum, no batch; without momentum all phases are zero
    gauge : as for `running_phases`
    times : (N,) where to draw [s]; None: several in each step of the integrator
    closing : as for `running_phases`

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> sp.plots.plot_phases(ax, motion, "base").get_xlabel()
    '$t$ [s]'
    """
    style.check_motion_axes(ax, motion)
    t = style.motion_times(motion, times)
    found = running_phases(motion, t, gauge, closing=closing)
    jumps = np.flatnonzero(np.diff(found.jumps))
    for values, name, look in (
        (found.dynamic_phase, r"dynamic $\theta_\mathrm{D}$", style.SERIES[0]),
        (found.geometric_phase, r"geometric $\theta_\mathrm{G}$", style.SERIES[1]),
        (found.montgomery_phase, r"total $\theta_\mathrm{M}$", _TOTAL),
    ):
        at_jumps = jumps if look is not style.SERIES[0] else jumps[:0]
        ax.plot(*_broken(t, values, at_jumps), label=f"{name} = {_degrees(values[-1])}", **look)
        for k in at_jumps:
            ax.plot(t[k : k + 2], values[k : k + 2], **_JUMPED)
    style.zero_line(ax)
    style.in_time(ax, (t[0], t[-1]), "", title=_phase_title(found, len(jumps)))
    style.degrees_first(ax, "phase")
    _enlarged(ax, t, found)
    return ax


def plot_attitude(ax: Axes, motion: Motion, kind: str = "rotation_vector", *, times: ArrayLike | None = None) -> Axes:
    """The attitude in time, base axes to inertial ones: its rotation vector and angle, or its quaternion x y z w.

    The rotation vector is `Motion.rotation_vector`: it goes on past half turns. Where it jumps nevertheless, because
    the attitude is the identity again after whole turns, the lines are interrupted. The quaternion does not change its
    sign.

    Parameters
    ----------
    ax : flat axes
    motion : no batch
    kind : "rotation_vector" [rad] or "quaternion"
    times : as for `plot_phases`

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> len(sp.plots.plot_attitude(ax, motion, "quaternion").lines) >= 4
    True
    """
    style.check_motion_axes(ax, motion)
    check_choice(kind, "kind of attitude", ATTITUDES)
    t = style.motion_times(motion, times)
    if kind == "quaternion":
        values = motion.quat_xyzw(t)
        values[1:] *= np.cumprod(np.where(np.sum(values[1:] * values[:-1], axis=-1) < 0.0, -1.0, 1.0))[:, None]
        _pieces(ax, t, values, [(f"$q_{name}$", style.SERIES[k]) for k, name in enumerate("xyzw")])
        ax.set_ylim(-1.08, 1.08)
        label, title = "quaternion [1]", "attitude, base to inertial axes: quaternion of one sign"
    else:
        values = motion.rotation_vector(t)
        _pieces(ax, t, values, [(rf"$\theta_{name}$", style.SERIES[k]) for k, name in enumerate("xyz")])
        size = np.linalg.norm(values, axis=-1)
        ax.plot(t, size, label=r"$|\theta|$", color=style.GREY, linewidth=2.2, zorder=1.5)
        for turn in np.arange(np.pi, size.max() + _HALF_TURN, np.pi):
            ax.axhline(turn, color=style.GREY, linewidth=0.5, linestyle=(0, (1, 2)), zorder=1)
        label, title = "", "attitude, base to inertial axes: rotation vector"
        title += "; dots: half turns" if size.max() > np.pi - _HALF_TURN else ""
    style.zero_line(ax)
    style.in_time(ax, (t[0], t[-1]), label, loops=motion.deformation.loops, ncols=4, title=title)
    if kind != "quaternion":
        style.degrees_first(ax, "rotation vector")
    return ax


def plot_inertia(
    ax: Axes, deformation: Deformation, kind: str = "principal", *, times: ArrayLike | None = None
) -> Axes:
    """The locked inertia in time: its principal moments, ascending, or its six entries in the deformation's frame.

    Parameters
    ----------
    ax : flat axes
    kind : "principal" or "entries"
    times : (N,) where to draw [s]; None: evenly between the breaks

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> len(sp.plots.plot_inertia(ax, motion.deformation).lines)  # one for each principal moment
    3
    """
    check_object(deformation, "Deformation", "deformation")
    style.check_flat_axes(ax)
    check_choice(kind, "kind of inertia", INERTIAS)
    t = style.even_times(deformation, times)
    inertia = deformation.inertia(t)
    if kind == "principal":
        for k, moment in enumerate(np.linalg.eigvalsh(inertia).T):
            ax.plot(t, moment, label=f"$I_{k + 1}$", **style.SERIES[k])
        ax.set_ylim(bottom=0.0)
    else:
        for k, (i, j, name) in enumerate(_ENTRIES):
            ax.plot(t, inertia[:, i, j], label=f"$I_{{{name}}}$", **style.SERIES[k])
        style.zero_line(ax)
    label, title = {
        "principal": ("principal moments [kg m²]", "locked inertia, about the centre of mass"),
        "entries": ("locked inertia [kg m²]", "locked inertia in the deformation's frame"),
    }[kind]
    style.in_time(ax, (t[0], t[-1]), label, loops=deformation.loops, ncols=3, title=title)
    return ax


def plot_internal_momentum(ax: Axes, deformation: Deformation, *, times: ArrayLike | None = None) -> Axes:
    """The internal angular momentum L_o in time, with the base at rest, in the deformation's frame, and its size.

    Parameters
    ----------
    ax : flat axes
    times : as for `plot_inertia`

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> sp.plots.plot_internal_momentum(ax, motion.deformation).get_xlabel()
    '$t$ [s]'
    """
    check_object(deformation, "Deformation", "deformation")
    style.check_flat_axes(ax)
    t = style.even_times(deformation, times)
    internal = deformation.internal_momentum(t)
    for k, name in enumerate("xyz"):
        ax.plot(t, internal[:, k], label=f"$L_{{o,{name}}}$", **style.SERIES[k])
    ax.plot(t, np.linalg.norm(internal, axis=-1), label="$|L_o|$", color=style.GREY, linewidth=2.2, zorder=1.5)
    style.zero_line(ax)
    style.in_time(
        ax,
        (t[0], t[-1]),
        "$L_o$ [kg m²/s]",
        title="momentum of the joints, the base at rest",
        loops=deformation.loops,
        ncols=4,
    )
    return ax


def plot_energy(
    ax: Axes,
    motion: Motion,
    *,
    certificate: RegimeCertificate | None = None,
    times: ArrayLike | None = None,
) -> Axes:
    """The energy E_t in time between the bands of the regimes of the body frozen at each time.

    With l the momentum's norm, the energy lies between l²/(2 I₃) and l²/(2 I₁). Above l²/(2 I₂), the energy on the
    separatrix, the frozen polhode circles the axis of the smallest moment, below it that of the largest. Where the
    farthest of these three would press the energy into a small part of the axis, the axis ends before it, and the
    legend has its end.

    Source: Cabrera 2006, section 4.1.1; theory.md E1, E5.

    Parameters
    ----------
    ax : flat axes
    motion : of one momentum, no batch
    certificate : its bounds of E_t, found without the motion, are drawn as steps; None: none
    times : as for `plot_phases`

    Raises
    ------
    ShapeError
        If the motion is a batch, or has no momentum.

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> sp.plots.plot_energy(ax, motion).get_xlabel()
    '$t$ [s]'
    """
    if certificate is not None:
        check_object(certificate, "RegimeCertificate", "certificate")
    style.check_motion_axes(ax, motion)
    magnitude = float(np.linalg.norm(motion.momentum))
    if not magnitude:
        raise ShapeError("a motion without angular momentum has E_t = 0 and no regimes")
    t = style.motion_times(motion, times)
    top, middle, bottom = (0.5 * magnitude * magnitude / np.linalg.eigvalsh(motion.deformation.inertia(t))).T
    bands: tuple[tuple[Array, Array, str, dict[str, Any]], ...] = (
        (middle, top, "about smallest moment", {"facecolor": "#FBE8C8", "edgecolor": style.ORANGE, "hatch": "///"}),
        (bottom, middle, "about largest moment", {"facecolor": "#CBE5F5", "edgecolor": style.SKY}),
    )
    for low, high, label, look in bands:
        if (high - low).max() > _NO_BAND * high.max():
            ax.fill_between(t, low, high, linewidth=0.0, label=label, zorder=1, **look)
    energy = energy_along(motion, t)
    low, high, beyond = _energy_range(energy, bottom, middle, top)
    limits = {"color": style.GREY, "linewidth": 0.8, "zorder": 1.5}
    seen = [label for label, values in ((_LEAST, top), (_MOST, bottom)) if np.any((values >= low) & (values <= high))]
    ax.plot(t, top, label=", ".join(seen) if seen else None, **limits)
    ax.plot(t, bottom, **limits)
    ax.plot(t, middle, label=_SEPARATRIX, color=style.BLACK, linestyle=(0, (5, 1.5)), linewidth=1.3)
    if certificate is not None:
        known = certificate.bounds
        edges = known.enclosure.edges
        for values, label in ((known.lower, "certain bounds"), (known.upper, None)):
            ax.stairs(
                values, edges, baseline=None, color=style.BLACK, linestyle=(0, (1, 1)), linewidth=1.2, label=label
            )
    ax.plot(t, energy, label="$E$", color=style.GREEN, linewidth=2.0)
    ax.set_ylim(low, high)
    title = "\n".join(["energy, and the axis that the momentum circles", *beyond])
    style.in_time(ax, (t[0], t[-1]), "energy [J]", loops=motion.deformation.loops, title=title)
    return ax


def plot_torques(
    ax: Axes, motion: Motion, joints: Sequence[str] | None = None, *, times: ArrayLike | None = None
) -> Axes:
    """The torques of the joints in time, and on an axis of their own the forces of those that slide.

    Parameters
    ----------
    ax : flat axes; where there are torques and forces, a twin of them is added to their figure
    motion : of an articulated body, no batch
    joints : names of those to draw; None: those that do anything. The six with the largest peaks are named, the others
        are grey
    times : (N,) where to draw [s]; None: several in each step of the integrator

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> len(sp.plots.plot_torques(ax, motion).lines)  # one for each joint
    3
    """
    style.check_motion_axes(ax, motion)
    t = style.motion_times(motion, times)
    found = joint_torques(motion, t)
    peaks = np.abs(found.torque).max(axis=0)
    if joints is None:
        chosen = np.flatnonzero(peaks > _IDLE * peaks.max(initial=0.0))
        chosen = chosen if len(chosen) else np.arange(len(peaks))
    else:
        given = names_argument(joints, "joints", "names")
        chosen = np.array([joint_place(name, found.joint_names) for name in given], int)
    if len(chosen) > MAX_NAMED:
        chosen = chosen[np.argsort(-peaks[chosen], kind="stable")]
    units = found.joint_units
    scales = sorted({units[k] for k in chosen}, reverse=True)
    places: dict[str, Any] = {unit: ax if n == 0 else ax.twinx() for n, unit in enumerate(scales)}
    legend = plot_joints(places, t, found.torque, chosen, found.joint_names, units, _TORQUE_UNITS)
    for unit, twin in list(places.items())[1:]:
        twin.set_ylabel(_TORQUE_LABELS[unit], fontsize=style.SMALL)
        twin.tick_params(labelsize=style.SMALL)
    if len(scales) > 1:
        style.align_zeros(*places.values())
    style.in_time(ax, (t[0], t[-1]), _TORQUE_LABELS[scales[0]] if scales else "", **legend)
    return ax


def _energy_range(energy: Array, bottom: Array, middle: Array, top: Array) -> tuple[float, float, list[str]]:
    """Ends of an axis on which the energy is seen, and a line about the curve that is beyond it, if one is."""
    curves = sorted(
        ((bottom, _MOST), (middle, _SEPARATRIX), (top, _LEAST)), key=lambda curve: np.abs(curve[0] - energy).max()
    )
    near = np.concatenate([energy, curves[0][0], curves[1][0]])
    far, name = curves[2]
    low, high = float(near.min()), float(near.max())
    whole = max(high, float(far.max())) - min(low, float(far.min()))
    beyond = []
    if high - low > _PRESSED * whole:
        low, high = min(low, float(far.min())), max(high, float(far.max()))
    else:
        up = far.max() > high
        end = f"{far.max() if up else far.min():.4g}"
        beyond = [f"{name} is beyond the axis, {'up' if up else 'down'} to {end} J"]
    room = _ROOM * ((high - low) or abs(high))
    return low - room, high + room, beyond


def _enlarged(ax: Any, t: Array, found: RunningPhases) -> None:
    """The geometric phase in an inset, where it would be a flat line beside the others."""
    reach = float(np.ptp(found.geometric_phase))
    whole = float(np.ptp(np.concatenate([found.dynamic_phase, found.montgomery_phase, np.zeros(1)])))
    inset = style.inset_where_free(ax, (0.27, 0.22), (0.19, 0.1, 0.09)) if _NOTHING < reach < _FLAT * whole else None
    if inset is not None:
        inset.plot(t, np.degrees(found.geometric_phase), **style.SERIES[1])
        style.zero_line(inset)
        inset.set_xlim(t[0], t[-1])
        inset.locator_params(nbins=3)
        inset.tick_params(labelsize=style.SMALL - 2, length=2.0, pad=1.5)
        inset.set_title(r"$\theta_\mathrm{G}$ [deg]", fontsize=style.SMALL - 1, pad=2.0)


def _phase_title(found: RunningPhases, jumps: int) -> str:
    """Title with the gauge, the gap of the curve at the last time drawn, and the phase that closing it adds."""
    lines = [f"{plain_text(found.gauge)} gauge"]
    gap, added = float(found.momentum_gap[-1]), float(found.closing_phase[-1])
    if gap > CLOSED_GAP and found.closing == "start":
        lines.append(f"open by {_degrees(gap)}; closing it adds {_degrees(added, sign=True)}")
    if jumps:
        lines.append(f"dots: {'a jump' if jumps == 1 else 'jumps'} by a whole sphere, 720°")
    return "\n".join(lines)


def _degrees(angle: float, *, sign: bool = False) -> str:
    """An angle in degrees with two digits after the point and a typographic minus sign."""
    return f"{np.degrees(angle):{'+' if sign else ''}z.2f}°".replace("-", "−")


def _broken(t: Array, values: Array, at: Integers) -> tuple[Array, Array]:
    """A line interrupted after some of its points: (N,), (N,) -> (M,), (M,)."""
    return np.insert(t, at + 1, np.nan), np.insert(values, at + 1, np.nan)


def _pieces(ax: Any, t: Array, values: Array, looks: list[tuple[str, dict[str, Any]]]) -> None:
    """Lines, interrupted where the values jump: (N,), (N, k)."""
    step = np.linalg.norm(np.diff(values, axis=0), axis=-1)
    cuts = [0, *(np.flatnonzero(step > _JUMP) + 1).tolist(), len(t)]
    for k, (label, look) in enumerate(looks):
        for start, end in pairwise(cuts):
            ax.plot(t[start:end], values[start:end, k], label=None if start else label, **look)
