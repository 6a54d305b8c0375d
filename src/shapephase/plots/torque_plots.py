"""The torques and forces of joints in time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object, names_argument
from ..dynamics.torques import joint_torques
from ..errors import unknown_name
from ..reconstruction.reconstruction import Motion
from ._joint_styles import joint_styles, plain_text
from .plot_style import GREY, SMALL, check_flat_axes, in_time, motion_times, one_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_NAMED = 6  # joints with a style and a name: more are not distinguishable
_MAX_BESIDE = 26  # letters of a name in a legend of two columns
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
    check_object(motion, "Motion", "motion")
    check_flat_axes(ax)
    one_motion(motion)
    t = motion_times(motion, times)
    found = joint_torques(motion, t)
    peaks = np.abs(found.torque).max(axis=0)
    if joints is None:
        chosen = np.flatnonzero(peaks > _IDLE * peaks.max(initial=0.0))
        chosen = chosen if len(chosen) else np.arange(len(peaks))
    else:
        chosen = np.array([_place(name, found.joint_names) for name in names_argument(joints, "joints", "names")], int)
    if len(chosen) > _MAX_NAMED:
        chosen = chosen[np.argsort(-peaks[chosen], kind="stable")]
    units = found.joint_units
    scales = sorted({units[k] for k in chosen}, reverse=True)
    places: dict[str, Any] = {unit: ax if n == 0 else ax.twinx() for n, unit in enumerate(scales)}
    handles: list[Any] = []
    texts: list[str] = []
    named = chosen[:_MAX_NAMED]
    for k, look in zip(named, joint_styles([found.joint_names[k] for k in named]), strict=True):
        handles += places[units[k]].plot(t, found.torque[:, k], **look)
        own = "" if len(scales) == 1 else f" [{_SHOWN[units[k]]}]"
        texts.append(plain_text(found.joint_names[k]) + own)
    others = [
        places[units[k]].plot(t, found.torque[:, k], color=GREY, linewidth=0.6, zorder=1.5)[0]
        for k in chosen[_MAX_NAMED:]
    ]
    if others:
        handles.append(others[0])
        texts.append("1 other" if len(others) == 1 else f"{len(others)} others")
    for unit, twin in list(places.items())[1:]:
        twin.set_ylabel(_LABELS[unit], fontsize=SMALL)
        twin.tick_params(labelsize=SMALL)
    columns = 1 if max(map(len, texts), default=0) > _MAX_BESIDE else 2
    above = {"ncols": columns, "loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
    in_time(ax, (t[0], t[-1]), _LABELS[scales[0]] if scales else "", handles=handles, labels=texts, **above)
    return ax


def _place(name: str, names: Sequence[str]) -> int:
    if name not in names:
        raise unknown_name("joint", name, names)
    return names.index(name)
