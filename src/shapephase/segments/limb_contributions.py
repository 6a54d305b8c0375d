"""Shares of the limbs in a turn: along the motion, with limbs held, and fairly shared over all subsets of limbs."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_keywords, check_object, number_argument, times_argument, vector_argument, whole_argument
from ..arrays import Array, read_only
from ..body.body import Body
from ..display import frozen, number_with_bar
from ..error_bars.error_sources import Inputs, inputs_of
from ..error_bars.recorded_momentum import RecordedMomentum
from ..errors import ShapeError, WrongObjectError, unknown_name
from ..letters import value_text
from ..phases.phases import split
from ..plain_data import plain
from ..reconstruction.motion_record import write_table
from ..reconstruction.reconstruction import Motion
from ..shape_space.connection import curvature
from ..shape_space.shape_path import CLOSED
from .coalitions import sampled_orders, shapley_interactions, shapley_weights, weights_of_orders
from .direct_shares import (
    ANGLES,
    STEEP,
    DirectRates,
    DirectShares,
    LinkChart,
    articulated_parts,
    direct_shares,
    rotors_of,
)
from .held_motions import MIRRORED, HeldMotions
from .limbs import CONDITIONS, WHEELS, JointGroups, SegmentTree, joint_groups
from .mirrored_motion import mirrored_motion
from .share_bars import ShareBars, result_covariance, share_bars

MOST_EXACT = 10  # groups of which all subsets are computed: 1,024 motions
_ROWS = 201  # times of the direct shares, as many as of other tables
RESULTS = (*ANGLES, "rotation", "phase")

Result = Callable[[Motion], float]


@frozen
class Contributions:
    """Shares of groups of joints in a result of a motion. Made by `contributions`; printing it shows a table.

    Attributes
    ----------
    of : "twist", "tilt", "somersault", "rotation", "phase", or the name of a function
    unit : of the table and the figure, "turns" for counts, else "deg"; "" for a function
    link : whose angle it is
    at : time of the tilt [s]; the duration for other results
    groups : names of joints by group
    rest : joints in no group, which move in all motions
    whole, none : result of the motion, and with all groups on the baseline [rad, or as the function has it]
    held_names : groups, then mirrored pairs
    without, alone : results with each of `held_names` on the baseline, and with it alone off the baseline
    shared : (k,) Shapley values of the groups; they add up to whole - none
    errors : (k,) estimates of the errors of `shared`; of sampled orders standard errors
    interactions : (k, k) Shapley-Taylor: alone on the diagonal, pairs beside it; None for sampled orders
    small_loop : (k, k) minus curvature times area, what a small loop without momentum tends to; None for other motions
    error : estimate of the error of `whole`, and of each held motion at most
    steep : groups that move in those motions whose tilt passes 85 degrees, where counts lose their meaning
    direct : what momentum and joints did along the motion; None for results without rates
    bars : by the noise of the recording; None where none is stated

    Examples
    --------
    >>> dive = sp.reconstruct(
    ...     sp.articulated(sp.load_body("diver"), sp.examples.MOTIONS["diver_twist"].path()), [0.0, 61.558831, 0.0]
    ... )
    >>> shares = sp.contributions(dive, of="somersault")
    >>> print(abs(shares.shared.sum() - (shares.whole - shares.none)) < 1e-12)
    True
    """

    of: str
    unit: str
    link: str
    at: float
    groups: dict[str, tuple[str, ...]]
    rest: tuple[str, ...]
    baseline: str
    whole: float
    none: float
    held_names: tuple[str, ...]
    without: Array
    alone: Array
    shared: Array
    errors: Array
    interactions: Array | None
    small_loop: Array | None
    error: float
    steep: tuple[str, ...]
    direct: DirectShares | None
    bars: ShareBars | None = None
    _pairs: dict[str, tuple[str, str]] = field(repr=False, default_factory=dict)
    _held: HeldMotions | None = field(repr=False, default=None)

    @property
    def scale(self) -> float:
        """Number of radians in `unit`; 1 for functions."""
        return {"turns": 2.0 * np.pi, "deg": np.pi / 180.0, "": 1.0}[self.unit]

    def __str__(self) -> str:
        """Return the table: held, alone and shared by group, then the direct shares."""
        return "\n".join(self._lines())

    def motions(self) -> dict[str, Motion]:
        """Return the motion itself, under the empty name, and with each of `held_names` on the baseline.

        Examples
        --------
        >>> cat = sp.load_body("cat_two_halves")
        >>> motion = sp.reconstruct(sp.articulated(cat, sp.examples.kane_scher(0.3, 0.6)), np.zeros(3))
        >>> list(sp.contributions(motion, of="rotation", about=[1.0, 0.0, 0.0], groups="joints").motions())
        ['', 'waist_pitch', 'waist_yaw', 'waist_roll']
        """
        held = self._held
        assert held is not None
        bits = _bits(held.names, self._pairs)
        made = held.motions({held.whole & ~bit for bit in bits.values()})
        return {"": held.motion} | {name: made[held.whole & ~bit] for name, bit in bits.items()}

    def text(self, value: float, bar: float = 0.0) -> str:
        """Return an angle as the table prints it, in `unit`."""
        if bar > 5e-4 * self.scale:
            return number_with_bar(value / self.scale, bar / self.scale)
        return f"{round(value / self.scale, 3) + 0.0:.3f}"

    @property
    def shared_bars(self) -> Array:
        """Bars of the Shapley values of `held_names`, by noise and random orders together: (h,) [rad].

        Without both they are estimates of numerical errors. Those of a mirrored pair are upper bounds.
        """
        errors = self._of_held(self.errors)
        return errors if self.bars is None else np.hypot(self.bars.shared, errors)

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Return the rows of the table: name, result without the group, result with it alone, shared.

        With bars of the noise where it is known, and of shares by random orders.
        """
        text, bars, exact = self.text, self.bars, np.zeros(len(self.held_names))
        of_held, of_alone, ends = exact, exact, (0.0, 0.0, 0.0)
        if bars is not None:
            of_held, of_alone, ends = bars.without, bars.alone, bars.ends
        held, alone, shared = (
            [text(value, bar) for value, bar in zip(values, widths, strict=True)]
            for values, widths in (
                (self.without, of_held),
                (self.alone, of_alone),
                (self._of_held(self.shared), self.shared_bars),
            )
        )
        totals = (text(self.none, ends[0]), text(self.whole, ends[1]), text(self.shared.sum(), ends[2]))
        return [*zip(self.held_names, held, alone, shared, strict=True), ("all groups", *totals)]

    def _of_held(self, values: Array) -> Array:
        """Sums over the members of each of `held_names`: (k,) -> (h,)."""
        own = dict(zip(self.groups, values, strict=True))
        return np.array([sum(own[member] for member in self._pairs.get(name, (name,))) for name in self.held_names])

    def direct_rows(self) -> list[tuple[str, str]]:
        """Return sources of the direct shares that did something, the largest first, with their totals."""
        if self.direct is None:
            return []
        shown = sorted(zip(self.direct.sources, self.direct.total, strict=True), key=lambda pair: -abs(pair[1]))
        return [(name, self.text(value)) for name, value in shown if abs(value) > 0.0]

    def _lines(self) -> list[str]:
        text = self.text
        wide = 2 + max(
            map(len, (*self.held_names, *(self.direct.sources if self.direct is not None else ()), "all groups"))
        )
        when = f" at {self.at:.4g} s" if self.of == "tilt" else ""
        unit = f" [{self.unit}]" if self.unit else ""
        error = f"numerical error {self.error / self.scale:.0e}"
        *_, (_, none, whole, _) = rows = self.rows()
        columns = 20 if self.bars is not None else 12
        last = columns + 6
        lines = [
            f"{self.of}{when} of {self.link}{unit}: {whole} ({error}); with all groups {self.baseline} {none}",
            "",
            f"{'':{wide}}{'held':>{columns}}{'alone':>{columns}}{'shared':>{last}}",
        ]
        lines += [
            f"{name:{wide}}{held:>{columns}}{alone:>{columns}}{shared:>{last}}" for name, held, alone, shared in rows
        ]
        if self.interactions is not None and len(self.groups) > 1:
            small = self.small_loop
            lines += ["", "pairs, beyond what both do alone" + ("" if small is None else "; what small loops tend to")]
            for first, second, value in self._strongest():
                own = "" if small is None else f"{text(small[first, second]):>12}"
                lines.append(f"{text(value):>12}{own}   {[*self.groups][first]} with {[*self.groups][second]}")
        if self.direct is not None:
            change = text(float(self.direct.total.sum())) + " in all"
            if self.of != "rotation":
                degrees = np.degrees(self.direct.largest_tilt)
                change += f", largest tilt {degrees:.1f} deg at {self.direct.tilt_time:.3g} s"
            lines += ["", f"direct, along the motion: {change}"]
            lines += [f"{name:{wide}}{value:>12}" for name, value in self.direct_rows()]
        for note in self.notes():
            lines += ["", *textwrap.wrap(note)]
        return lines

    def notes(self) -> list[str]:
        """Return what limits the meaning of the shares: joints that always move, steep tilts, phases that jump.

        Examples
        --------
        >>> cat = sp.load_body("cat_two_halves")
        >>> motion = sp.reconstruct(sp.articulated(cat, sp.examples.kane_scher(0.3, 0.6)), np.zeros(3))
        >>> sp.contributions(motion, of="rotation", about=[1.0, 0.0, 0.0], groups={"pitch": ["waist_pitch"]}).notes()
        ['in no group, moving in all motions: waist_yaw, waist_roll']
        """
        notes = [f"in no group, moving in all motions: {', '.join(self.rest)}"] if self.rest else []
        if self.bars is not None:
            orders = " and random orders" if self.interactions is None else ""
            notes.append(f"±: one standard deviation, by the noise of the recording{orders}")
        if self.steep:
            notes.append(f"tilt beyond 85 deg, counts without meaning, in motions of: {'; '.join(self.steep)}")
        if self.of == "phase" and np.ptp([self.whole, self.none, *self.without, *self.alone]) > np.pi:
            notes.append(
                "phases differ by more than half a turn: where the end of the momentum passes the point opposite its "
                "start, the great circle that closes it jumps, and the phase by 360 deg"
            )
        return notes

    def _strongest(self) -> list[tuple[int, int, float]]:
        """Pairs of groups with the largest interactions, six at most."""
        assert self.interactions is not None
        count = len(self.groups)
        pairs = [(i, j, float(self.interactions[i, j])) for i in range(count) for j in range(i + 1, count)]
        return sorted(pairs, key=lambda pair: -abs(pair[2]))[:6]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON can hold it, angles in radians."""
        return plain(self) | {
            "unit": "rad" if self.unit else "",
            "pairs": {both: list(pair) for both, pair in self._pairs.items()},
        }

    def write_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the direct shares in time: time_s, angle_rad, and one column in rad for each source.

        Raises
        ------
        WrongObjectError
            For a result without direct shares.
        """
        if self.direct is None:
            raise WrongObjectError(
                f"{self.of} has no direct shares in time; take 'twist', 'tilt', 'somersault' or 'rotation'"
            )
        columns = {f"{name}_rad": self.direct.shares[:, k] for k, name in enumerate(self.direct.sources)}
        write_table(path, {"time_s": self.direct.times, "angle_rad": self.direct.angle, **columns})


def contributions(
    motion: Motion,
    of: str | Result = "twist",
    *,
    groups: str | Mapping[str, str | Iterable[str]] = "limbs",
    baseline: str | ArrayLike | Motion = "first",
    at: str | float = "mid-twist",
    about: ArrayLike | None = None,
    link: str | None = None,
    times: ArrayLike | None = None,
    orders: int = 200,
    seed: int = 0,
    joints: ArrayLike | str | None = None,
    start: RecordedMomentum | ArrayLike | None = None,
    **axes: Any,
) -> Contributions:
    """Return the shares of limbs in a twist, tilt, somersault or another result of a motion, in three exact readings.

    *Direct*: the angle's rate is at every instant a sum over the momentum and the joints; its integrals say what each
    did along the motion that took place. *Held*: the motion again with a group of joints on the baseline, and with that
    group alone off it. *Shared*: Shapley values, which average what a group adds over all orders in which groups join;
    they add up to the whole. They answer different questions, and none says what an athlete did on purpose.

    Source: Yeadon 1993 (simulations with techniques taken out); Shapley 1953; docs/howto/contributions.md.

    Parameters
    ----------
    motion : made by `reconstruct` of `articulated(body, path)`
    of : "twist" or "somersault" (counts, followed in time), "tilt" (at the time `at`), "rotation" (turn about `about`),
        "phase" (Montgomery's, horizontal gauge), or a function of a Motion that returns a number
    groups : "limbs", "joints", or patterns of joint names by group, `{"arms": ["left_*", "right_*"]}`; where another
        motion is the baseline also "momentum", "attitude", "duration" and "body", with an empty pattern. What wheels
        store is the group "wheels" of the first two, and with an empty pattern beside others; without it they store
        nothing, or as much as in the other motion
    baseline : "first" posture, "neutral" posture, a shape (n,), another motion of the same joints, or "mirrored", the
        motion with left and right exchanged
    at : time of the tilt [s], or "mid-twist", when the motion has done half of its twist
    about : (3,) axis in inertial axes; None: the momentum
    link : whose angles; None: the trunk
    times : (N,) of the direct shares [s]; None: 201 even ones
    orders, seed : of random orders of groups, for more than 10 groups
    joints, start : errors of the samples of joints, and of momentum and attitude at the start, as for `uncertainty`:
        twist, tilt and somersault against a posture then have error bars, to first order
    axes : lateral, longitudinal (axes of the link), somersault, up, as for `Motion.athlete_axes`

    Raises
    ------
    WrongObjectError, UnknownNameError, ShapeError
        For another kind of motion, an unknown word, a joint in two groups, or a difference of two motions in no group;
        for errors beside a result or a baseline without bars, and as `uncertainty` raises.
    ChartPoleError
        If the tilt of the motion passes 85 degrees and `of` is one of the three angles.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> motion = sp.reconstruct(sp.articulated(cat, sp.examples.kane_scher(0.3, 0.6)), [0.0, 0.0, 0.0])
    >>> shares = sp.contributions(motion, of="rotation", about=[1.0, 0.0, 0.0], groups="joints")
    >>> print(shares.held_names, np.abs(shares.without).max().round(2) < abs(shares.whole))
    ('waist_pitch', 'waist_yaw', 'waist_roll') True
    """
    check_object(motion, "Motion", "motion")
    check_keywords(axes, contributions, ("lateral", "longitudinal", "somersault", "up"))
    if motion.batch:
        raise ShapeError(f"motion: one motion is needed, this is a batch of {motion.batch}")
    is_mirrored, inputs = isinstance(baseline, str) and baseline == MIRRORED, None
    if joints is not None or start is not None:
        if callable(of) or of not in ANGLES or isinstance(baseline, Motion) or is_mirrored:
            raise WrongObjectError(
                "joints and start: error bars are those of twist, tilt and somersault against a posture; leave them out"
            )
        inputs = inputs_of(motion, joints, None, None, None, start, None)
    body, _ = articulated_parts(motion.deformation)
    tree, wheels = SegmentTree(body), tuple(rotor.joint for rotor in rotors_of(motion.deformation))
    conditions, chosen = _conditions(groups)
    if conditions is not None and WHEELS in conditions and not wheels:
        raise ShapeError(f"groups: the motion has no wheels; leave {WHEELS} out, or give their momentum (rotors=)")
    grouped = _without_wheels(joint_groups(body, chosen), body, wheels)
    compared = mirrored_motion(motion, **axes) if is_mirrored else baseline
    held = HeldMotions(motion, grouped.columns, compared, conditions, grouped.rest)
    if WHEELS in held.conditions:
        grouped = replace(grouped, joints=grouped.joints | {WHEELS: wheels})
    else:
        grouped = replace(grouped, rest=(*grouped.rest, *wheels))
    if not held.names:
        raise ShapeError("groups: one group at least is needed, such as {'arms': ['left_*', 'right_*']}, or 'limbs'")
    whole_argument(orders, "orders", 2)
    whole_argument(seed, "seed", 0)
    function = of if callable(of) else None
    name = getattr(of, "__name__", "function") if callable(of) else of
    if not callable(of) and (not isinstance(of, str) or of not in RESULTS):
        raise unknown_name("result", of, RESULTS)
    if function is None and name == "phase" and not motion.momentum.any():
        raise WrongObjectError("of: without momentum there is no Montgomery phase; take 'twist' or 'rotation'")
    if about is not None and (function is not None or name != "rotation"):
        raise ShapeError(f"about: an axis is that of a rotation, not of {name}; leave it out, or take of='rotation'")
    if name != "tilt" and not (isinstance(at, str) and at == "mid-twist"):
        raise ShapeError(f"at: a time is that of a tilt, not of {name}, got {value_text(at)}; take of='tilt'")
    direct, chart, instant = None, None, motion.duration
    axis = np.zeros(3)
    if function is None and name != "phase":
        chart = LinkChart.of(motion, tree.trunk if link is None else link, name in ANGLES, **axes)
        if name == "rotation":
            axis = _axis(motion, about)
        if name == "tilt":
            instant = _instant(motion, chart, at)
        sampled = np.linspace(0.0, motion.duration, _ROWS) if times is None else times_argument(times, motion.duration)
        direct = direct_shares(DirectRates(motion, chart, name, axis, tree.joints), np.ravel(sampled), instant)
    measure = _Measure(name, function, chart, axis, instant / motion.duration)
    unit = "" if function is not None else "turns" if name in ("twist", "somersault") else "deg"
    return _shares(held, measure, grouped, direct, _Choice(name, unit, baseline, instant, chart, orders, seed, inputs))


@dataclass(frozen=True, eq=False)
class _Choice:
    of: str
    unit: str
    baseline: Any
    at: float
    chart: LinkChart | None
    orders: int
    seed: int
    inputs: Inputs | None


def _shares(
    held: HeldMotions, measure: _Measure, grouped: JointGroups, direct: DirectShares | None, choice: _Choice
) -> Contributions:
    names, whole = held.names, held.whole
    bits = _bits(names, grouped.pairs)
    removals = {*bits.values()} | {whole & ~bit for bit in bits.values()} | {0, whole}
    count = len(names)
    interactions = None
    if count <= MOST_EXACT:
        motions = _motions(held, range(1 << count))
        results = {subset: measure(motion) for subset, motion in motions.items()}
        function, error = (np.array([results[mask][part] for mask in range(1 << count)]) for part in (0, 1))
        weights = shapley_weights(count)
        shared, errors = weights @ function, np.abs(weights) @ error
        interactions = shapley_interactions(function)
    else:
        order, before = sampled_orders(count, choice.orders, choice.seed)
        motions = _motions(held, {int(mask) for mask in before.ravel()} | removals)
        results = {subset: measure(motion) for subset, motion in motions.items()}
        function = np.array([[results[int(mask)][0] for mask in row] for row in before])
        gains = np.take_along_axis(np.diff(function, axis=1), np.argsort(order, axis=1), axis=1)
        shared, errors = gains.mean(axis=0), gains.std(axis=0, ddof=1) / np.sqrt(len(gains))
        weights = weights_of_orders(order, before, [*motions])
    bars = None
    if choice.inputs is not None:
        assert measure.chart is not None
        covariance = result_covariance(held, motions, measure.chart, measure.of, measure.fraction, choice.inputs)
        bars = share_bars(covariance, [*motions], [*bits.values()], weights)
    steep = [mask for mask, (_, _, tilt) in results.items() if tilt > STEEP]
    baseline = choice.baseline
    named = "as in the baseline" if isinstance(baseline, Motion) else (
        "as in the mirrored motion" if isinstance(baseline, str) and baseline == MIRRORED else
        f"held at the {baseline} posture" if isinstance(baseline, str) else "held at the given posture"
    )  # fmt: skip
    if WHEELS in held.conditions and held.compares_posture:
        named += ", wheels without momentum"
    return Contributions(
        of=choice.of,
        unit=choice.unit,
        link=choice.chart.link if choice.chart is not None else held.body.link_names[0],
        at=choice.at,
        groups={name: grouped.joints.get(name, ()) for name in names},
        rest=grouped.rest,
        baseline=named,
        whole=results[whole][0],
        none=results[0][0],
        held_names=tuple(bits),
        without=np.array([results[whole & ~bit][0] for bit in bits.values()]),
        alone=np.array([results[bit][0] for bit in bits.values()]),
        shared=shared,
        errors=errors,
        interactions=interactions,
        small_loop=_small_loop(held, choice),
        error=max(bar for _, bar, _ in results.values()),
        steep=tuple(" + ".join(n for k, n in enumerate(names) if mask >> k & 1) or "none" for mask in steep),
        direct=direct,
        bars=bars,
        _pairs=grouped.pairs,
        _held=held,
    )


def _bits(names: Iterable[str], pairs: Mapping[str, tuple[str, str]]) -> dict[str, int]:
    """Return the subset of each group and of each mirrored pair, as bits."""
    bits = {name: 1 << place for place, name in enumerate(names)}
    return bits | {both: bits[first] | bits[second] for both, (first, second) in pairs.items()}


@dataclass(frozen=True, eq=False)
class _Measure:
    """A number of a motion, with its error estimate and the largest tilt."""

    of: str
    function: Result | None
    chart: LinkChart | None
    about: Array
    fraction: float

    def __call__(self, motion: Motion) -> tuple[float, float, float]:
        error = float(motion.error_estimate)
        if self.function is not None:
            try:
                value = self.function(motion)
            except (TypeError, AttributeError) as error:
                raise WrongObjectError(f"of: the function {self.of} does not take a Motion: {error}") from error
            if not isinstance(value, int | float | np.number) or not np.isfinite(value):
                raise ShapeError(f"of: the function must return a finite number for a motion, got {value_text(value)}")
            return float(value), error, 0.0
        if self.of == "phase":
            return float(split(motion).montgomery_phase), error, 0.0
        assert self.chart is not None
        if self.of == "rotation":
            body, _ = articulated_parts(motion.deformation)
            shares = direct_shares(
                DirectRates(motion, self.chart, self.of, self.about, {"all": tuple(range(body.n_shape))}),
                np.array([motion.duration]),
                motion.duration,
            )
            return float(shares.angle[0]), float(shares.error[0]), 0.0
        instants = np.append(motion.solution.times, self.fraction * motion.duration)
        angles = self.chart.angles(motion, instants)
        tilt = float(np.abs(angles[:, 1]).max())
        column = ANGLES.index(self.of)
        value = angles[-1, column] if self.of == "tilt" else angles[-1, column] - angles[0, column]
        return float(value), 2.0 * error / max(abs(np.cos(tilt)), 1e-12), tilt


def _motions(held: HeldMotions, subsets: Iterable[int]) -> dict[int, Motion]:
    """Motions of subsets in ascending order; the motion itself is not computed again."""
    wanted = set(subsets)
    made = held.motions(wanted - {held.whole}) | {held.whole: held.motion}
    return {subset: made[subset] for subset in sorted(wanted)}


def _conditions(groups: Any) -> tuple[list[str] | None, Any]:
    """Conditions among the groups, and the groups of joints; None where none were chosen by name."""
    if not isinstance(groups, Mapping):
        return None, groups
    known = (*CONDITIONS, WHEELS)
    conditions = [name for name, patterns in groups.items() if name in known and not patterns]
    return conditions, {name: patterns for name, patterns in groups.items() if name not in conditions}


def _without_wheels(grouped: JointGroups, body: Body, wheels: tuple[str, ...]) -> JointGroups:
    """Groups without the joints of wheels, which have a group of their own."""
    turned = {body.joint_index(name) for name in wheels}
    joints = {group: tuple(name for name in names if name not in wheels) for group, names in grouped.joints.items()}
    columns = {group: tuple(c for c in own if c not in turned) for group, own in grouped.columns.items()}
    left = {group for group, own in columns.items() if own}
    return JointGroups(
        columns={group: own for group, own in columns.items() if group in left},
        joints={group: names for group, names in joints.items() if group in left},
        rest=tuple(name for name in grouped.rest if name not in wheels),
        pairs={both: pair for both, pair in grouped.pairs.items() if left.issuperset(pair) and both != WHEELS},
    )


def _axis(motion: Motion, about: ArrayLike | None) -> Array:
    axis = motion.momentum if about is None else vector_argument(about, "about")
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise ShapeError(
            "about: an axis (3,) in inertial axes, not all zero, is needed where there is no momentum to turn about, "
            "such as [1, 0, 0] (--about 1 0 0)"
        )
    return axis / length


def _instant(motion: Motion, chart: LinkChart, at: str | float) -> float:
    """Time of the tilt [s]."""
    if isinstance(at, str):
        if at != "mid-twist":
            raise unknown_name("time of the tilt", at, ["mid-twist", "a time in s"])
        instants = np.union1d(np.linspace(0.0, motion.duration, 1025), motion.solution.times)
        twist = chart.angles(motion, instants)[:, 2]
        done = (twist - twist[0]) - 0.5 * (twist[-1] - twist[0])
        first = int(np.argmax(done * done[-1] >= 0.0))
        if first == 0:
            return 0.5 * motion.duration
        left, right = instants[first - 1], instants[first]
        return float(left + (right - left) * done[first - 1] / (done[first - 1] - done[first]))
    return float(times_argument(number_argument(at, "at", "s"), motion.duration))


def _small_loop(held: HeldMotions, choice: _Choice) -> Array | None:
    """Minus curvature at the first posture times projected areas, by pairs: (k, k); None for other motions."""
    motion, chart = held.motion, choice.chart
    body, path = articulated_parts(motion.deformation)
    closes = float(np.abs(path.gap).max(initial=0.0)) <= CLOSED and not motion.momentum.any()
    if held.conditions or not closes or not held.at_first_posture or chart is None or body.ball_joints:
        return None
    if choice.of not in ("twist", "somersault"):
        return None
    times = np.linspace(0.0, motion.duration, 4097)  # even samples of a smooth loop: their sum converges fast
    shapes, rates = path.curve(times)
    moved = (shapes - shapes[0])[:-1]
    turns = np.einsum("ni,nj->ij", moved, rates[:-1]) * (times[1] - times[0])
    areas = 0.5 * (turns - turns.T)
    vectors = -curvature(body, shapes[0]) * areas[..., None]
    row = chart.rates(chart.attitude(motion, np.zeros(1)), None)[0][0, ANGLES.index(choice.of)]
    axes = motion.attitude(0.0).T @ chart.attitude(motion, np.zeros(1))[0]
    by_pair = 0.5 * vectors @ axes @ row
    result = np.zeros((len(held.names),) * 2)
    columns = list(held.columns.values())
    for i, first in enumerate(columns):
        for j, second in enumerate(columns):
            block = by_pair[np.ix_(list(first), list(second))].sum()
            result[i, j] = block if i == j else 2.0 * block
    return read_only(result)
