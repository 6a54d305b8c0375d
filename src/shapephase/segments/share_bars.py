"""Error bars of shares, by the noise of a recording: from derivatives of the motion with each group held."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..arrays import Array
from ..body.link_motions import link_motions
from ..display import frozen
from ..error_bars.covariance import carried_errors
from ..error_bars.error_sources import Inputs
from ..error_bars.result_derivatives import described_by, turns_by_shapes, turns_by_start
from ..reconstruction.reconstruction import Motion
from ..shape_space.path_samples import path_samples
from .direct_shares import ANGLES, LinkChart
from .held_motions import HeldMotions


@frozen
class ShareBars:
    """Standard deviations of shares by the noise of a recording, to first order. Made by `contributions`.

    Attributes
    ----------
    whole, none, change : of the result of the motion, of that with all groups on the baseline, and of their difference
        [rad]
    without, alone, lost : (h,) of the results with each of `held_names` on the baseline, with it alone off it, and of
        what the whole is more than the first [rad]
    shared : (h,) of the Shapley values, of a mirrored pair of both together [rad]
    """

    whole: float
    none: float
    change: float
    without: Array
    alone: Array
    lost: Array
    shared: Array

    @property
    def ends(self) -> tuple[float, float, float]:
        """`none`, `whole` and `change`."""
        return self.none, self.whole, self.change


def result_covariance(
    held: HeldMotions, motions: Mapping[int, Motion], chart: LinkChart, of: str, fraction: float, inputs: Inputs
) -> Array:
    """Covariance of an angle's results in the motions of subsets, in the order of the mapping: (q, q) [rad^2].

    of, fraction : one of `ANGLES`, and of the tilt when, of the duration; other angles are those of the end less the
        start. Axes and that time count as exact
    inputs : errors of the joints, and of a momentum and start that all the motions share
    """
    by_knots, by_start = [], []
    for subset, motion in motions.items():
        times = np.unique([0.0, (fraction if of == "tilt" else 1.0) * motion.duration])
        signs = np.ones(len(times))
        signs[:-1] = 0.0 if of == "tilt" else -1.0
        shapes, rates = described_by(motion).route.curve(times)
        links = link_motions(held.body.chain, shapes, rates)
        axes = links.turns[:, chart.frame] @ chart.pose
        rows, _ = chart.rates(motion.attitude(times) @ axes, None)
        by_turns = signs[:, None] * (axes @ rows[:, ANGLES.index(of), :, None])[..., 0]
        by_start.append(by_turns.ravel() @ turns_by_start(motion, times))
        by_knots.append(_by_knots(held, subset, motion, times, by_turns, chart.frame))
    return carried_errors(held.motion, inputs, np.array(by_knots), np.array(by_start))


def share_bars(covariance: Array, subsets: list[int], removals: list[int], weights: Array) -> ShareBars:
    """Bars from the covariance of the results of ascending subsets.

    covariance : (q, q) of `result_covariance`, of subsets from the empty one to that of all k groups
    removals : subset of each group and of each mirrored pair
    weights : (k, q) of the results in the shares of the groups
    """
    of_results, members = dict(zip(subsets, np.eye(len(subsets)), strict=True)), np.arange(len(weights))
    none, whole = of_results[subsets[0]], of_results[subsets[-1]]
    without = np.array([of_results[subsets[-1] & ~removed] for removed in removals])

    def bars(rows: Array | list[Array]) -> Array:
        return np.sqrt(np.maximum(np.einsum("rq,qp,rp->r", rows, covariance, rows), 0.0))

    ends = bars([whole, none, whole - none])
    return ShareBars(
        whole=float(ends[0]),
        none=float(ends[1]),
        change=float(ends[2]),
        without=bars(without),
        alone=bars([of_results[removed] for removed in removals]),
        lost=bars(whole - without),
        shared=bars((np.array(removals)[:, None] >> members & 1) @ weights),
    )


def _by_knots(held: HeldMotions, subset: int, motion: Motion, times: Array, by_turns: Array, frame: int) -> Array:
    """Derivative by the recorded path at its knots, of a number that depends on attitudes of a link: (knots n,).

    by_turns : (N, 3) by turns of the link at N times, base axes
    """
    described = described_by(motion)
    samples = path_samples(described_by(held.motion).path)
    wheels = [rotor.joint for rotor in described.rotors]
    driven = [column for column, name in enumerate(held.body.joint_names) if name not in wheels]
    nodes, by_shape, by_rate = turns_by_shapes(motion, times, by_turns.reshape(1, -1))
    # The link turns in the body, too, by a unit of each joint.
    shapes, _ = described.route.curve(times)
    units = np.eye(held.body.n_shape)[driven]
    turned = np.array(
        [link_motions(held.body.chain, np.tile(at, (len(units), 1)), units).spins[:, frame] for at in shapes]
    )
    in_body = np.einsum("nki,ni->nk", turned, by_turns)[:, None]
    own = held.own_columns(subset)[driven]
    by_knots = samples.by_knots(nodes, by_shape * own, by_rate * own)
    by_knots = by_knots + samples.by_knots(times, in_body * own, np.zeros_like(in_body))
    if held.at_first_posture:
        still = (by_shape.sum(axis=0) + in_body.sum(axis=0)) * ~own
        by_knots = by_knots + samples.by_knots(np.zeros(1), still[None], np.zeros_like(still)[None])
    return by_knots[0]
