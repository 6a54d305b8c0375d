"""The torques and forces of joints in time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import names_argument
from ..dynamics.torques import joint_torques
from ..reconstruction.reconstruction import Motion
from ._joint_styles import MAX_NAMED, joint_place, plot_joints
from .plot_style import SMALL, check_motion_axes, in_time, motion_times

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_IDLE = 1e-9  # of the largest torque or force: a joint that does nothing
_SHOWN = {"rad": "N m", "m": "N"}
_LABELS = {"rad": "torques [N m]", "m": "forces [N]"}


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
    check_motion_axes(ax, motion)
    t = motion_times(motion, times)
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
    legend = plot_joints(places, t, found.torque, chosen, found.joint_names, units, _SHOWN)
    for unit, twin in list(places.items())[1:]:
        twin.set_ylabel(_LABELS[unit], fontsize=SMALL)
        twin.tick_params(labelsize=SMALL)
    in_time(ax, (t[0], t[-1]), _LABELS[scales[0]] if scales else "", **legend)
    return ax
