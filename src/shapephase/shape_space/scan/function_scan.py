"""Functions of time given by a user, and the results of scanning them before integration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Array, Mask, check_finite
from ...errors import TrajectoryError
from ...integrator.resolved import ResolvedPath
from ..curves import Curve

# Times (N,), columns (N, 2 n) -> weights (2 n,) [rad per unit of a column], sizes (2 n,) [unit of a column].
Judge = Callable[[Array, Array], tuple[Array, Array]]


@dataclass(frozen=True, kw_only=True)
class Words:
    """Terms for messages about a function.

    units : of values and of rates
    continuous : why a value cannot jump
    rate, values, returned : of what is a derivative: its name, what it is the derivative of, what to return
    """

    units: tuple[str, str]
    continuous: str
    rate: str = "rate"
    values: str = "values"
    returned: str = "(values, rates)"


@dataclass(frozen=True, eq=False, kw_only=True)
class ScannedFunction:
    """Columns of time as a user gives them: values, and as many rates; zeros stand for what there is not.

    What a column is off by matters as far as it turns the body. So all columns are scanned times their weights, in
    rad, as the angles of joints are: a value times its weight is, to first order and at most, the turn by which the
    attitude is off when the value is; a rate times its weight is the rate of that turn [rad/s]. Then one set of
    thresholds serves joints, metres and kg m^2, and does not depend on the units in which a body is described.

    curve : values and rates at times (N,): (N, n), (N, n)
    judge : the weights, and the sizes of the numbers that columns are computed from where these are larger than the
        columns themselves: of them the rounding is
    paired, angles, may_jump : (n,) True if a rate is the derivative of its value; if a value may go on at another
        turn; whether it may jump at a break that was declared
    subject : the function, in messages
    columns, quantities : names of the n values, and of all 2 n columns
    words : for messages
    """

    curve: Curve
    judge: Judge
    paired: Mask
    angles: Mask
    may_jump: Mask
    subject: str
    columns: tuple[str, ...]
    quantities: tuple[str, ...]
    words: Words

    @property
    def n_values(self) -> int:
        """Number of values."""
        return len(self.columns)


_PATH_WORDS = Words(
    units=("rad or m", "rad/s or m/s"),
    continuous="a shape must be continuous",
    values="shapes",
    returned="(shapes, rates)",
)

_MIXED_WORDS = Words(units=("in its unit", "in its unit per s"), continuous="what moves must be continuous")


def path_function(curve: Curve, n_shape: int, joint_names: Sequence[str] | None) -> ScannedFunction:
    """The joints of a path, each in its own unit."""
    columns = tuple(f"joint {joint_names[k]}" if joint_names else f"joint number {k}" for k in range(n_shape))
    every = np.ones(n_shape, dtype=bool)
    return ScannedFunction(
        curve=curve,
        judge=lambda _times, _columns: (np.ones(2 * n_shape), np.zeros(2 * n_shape)),
        paired=every,
        angles=every,
        may_jump=~every,
        subject="the path's function",
        columns=columns,
        quantities=tuple(f"{kind} of {column}" for kind in ("shape", "rate") for column in columns),
        words=_PATH_WORDS,
    )


def side_by_side(functions: Sequence[ScannedFunction], subject: str) -> ScannedFunction:
    """Several functions as one; `subject` stands for all of them."""
    if len(functions) == 1:
        return replace(functions[0], subject=subject)
    counts = [function.n_values for function in functions]
    n = sum(counts)
    stops = np.cumsum(counts)
    parts = [slice(int(stop) - count, int(stop)) for stop, count in zip(stops, counts, strict=True)]

    def curve(times: Array) -> tuple[Array, Array]:
        pairs = [function.curve(times) for function in functions]
        return np.concatenate([pair[0] for pair in pairs], axis=1), np.concatenate([pair[1] for pair in pairs], axis=1)

    def judge(times: Array, columns: Array) -> tuple[Array, Array]:
        weights, sizes = np.empty(2 * n), np.empty(2 * n)
        for function, part in zip(functions, parts, strict=True):
            rows = np.r_[part, n + part.start : n + part.stop]
            weights[rows], sizes[rows] = function.judge(times, columns[:, rows])
        return weights, sizes

    return ScannedFunction(
        curve=curve,
        judge=judge,
        paired=np.concatenate([function.paired for function in functions]),
        angles=np.concatenate([function.angles for function in functions]),
        may_jump=np.concatenate([function.may_jump for function in functions]),
        subject=subject,
        columns=tuple(name for function in functions for name in function.columns),
        quantities=tuple(
            name
            for rates in (False, True)
            for function, count in zip(functions, counts, strict=True)
            for name in function.quantities[rates * count : (1 + rates) * count]
        ),
        words=functions[0].words if len({f.words for f in functions}) == 1 else _MIXED_WORDS,
    )


@dataclass(frozen=True, eq=False)
class FunctionScan:
    """Result of scanning a function.

    resolved : values and rates as series, times their weights
    found_breaks : (K,) times of kinks that were not declared [s]
    evaluations : times at which the function was evaluated
    calls : of the function
    noise : of the values, and of the rates times half the width of a panel, as far as series meet it [rad or m]
    """

    resolved: ResolvedPath
    found_breaks: Array
    evaluations: int
    calls: int
    noise: float

    @property
    def panels(self) -> int:
        """Number of panels that resolve the function to rounding."""
        return len(self.resolved.left)

    @property
    def rate_defect(self) -> float:
        """Difference between the integrals of rates and their values, summed over panels where above rounding [rad]."""
        return self.resolved.defect

    @property
    def duration(self) -> float:
        """[s]."""
        return self.resolved.duration

    def __str__(self) -> str:
        """Numbers of panels, evaluations and breaks."""
        breaks = f", {len(self.found_breaks)} breaks found" if len(self.found_breaks) else ""
        return f"{self.panels} panels from {self.evaluations} evaluations in {self.calls} calls{breaks}"


def check_rates(curve: Curve, breaks: Array) -> None:
    """Compare the function's rates with differences of its shapes away from the breaks.

    At two steps: where these disagree with each other, as on the flank of a burst, nothing follows from them.
    """
    left, width = breaks[:-1], np.diff(breaks)
    middle = left + 0.381 * width
    coarse, _, _ = _differences(curve, middle, 1e-4 * width)
    slope, rate, spread = _differences(curve, middle, 1e-5 * width)
    scale = np.abs(rate) + np.maximum(spread, 1e-9) / breaks[-1]
    wrong = np.abs(slope - rate) > 1e-3 * scale + 10.0 * np.abs(slope - coarse)
    if wrong.any():
        where, joint = (int(i) for i in np.argwhere(wrong)[0])
        raise TrajectoryError(
            f"the path's function gives the rate {rate[where, joint]:.6g} of joint number {joint} at "
            f"{middle[where]:.6g} s, but its shapes change at {slope[where, joint]:.6g}; return (shapes, rates)"
        )


def _differences(curve: Curve, middle: Array, step: Array) -> tuple[Array, Array, Array]:
    """Slopes of the shapes by central differences of order four, rates as given, spread of the shapes."""
    shapes, rates = curve(np.concatenate([middle + k * step for k in (-2, -1, 0, 1, 2)]))
    check_finite(shapes, "shapes of the path's function")
    a, b, _, d, e = shapes.reshape(5, len(middle), -1)
    slopes = (a - 8 * b + 8 * d - e) / (12 * step[:, None])
    return slopes, rates.reshape(5, len(middle), -1)[2], np.ptp(shapes, axis=0)
