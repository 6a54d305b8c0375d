"""Checks of user input: each takes an argument as given and returns it ready for use, or raises."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Collection, Iterable, Mapping
from inspect import signature
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from . import so3
from .arrays import Array, common_batch, finite_array
from .errors import (
    LocalFunctionError,
    ShapeError,
    TrajectoryError,
    UnphysicalInertiaError,
    WrongObjectError,
    unknown_name,
)
from .inertia_tensor import inverse_inertia
from .letters import article, value_text

Made = TypeVar("Made")
TIGHTEST_TOLERANCE = 1e-13  # [rad]; a few hundred roundings, which many steps add up to
LOOSEST_TOLERANCE = 1e-4  # [rad]; the error estimates are first order and hold for small errors only
LEAST_SIZE = 1e-60  # times [s], masses [kg] and the like: fifth powers of smaller ones vanish
LARGEST_SIZE = 1e60  # fifth powers of larger ones overflow
_BY_VALUE = frozenset({"cloudpickle", "dill"})  # packages that pickle a function with its code, not by its name
ON_UNPHYSICAL = ("allow", "warn", "error")

_TIME_SLACK = 1e-9  # relative to T, of a time outside [0, T]: rounding of a user's own arithmetic
_ASYMMETRY = 1e-9  # of a tensor, relative to its largest entry: printed digits
_LEAST_MOMENT_RATIO = 1e-12  # of principal moments: below it the inverse has no correct digits left
_LARGEST_MOMENTUM = 1e100  # [kg m^2/s]; squares of larger ones overflow
_MADE_BY: dict[str, str] = {}  # class -> the call that makes one of it
_INSIDE: dict[tuple[str, str], str] = {}  # (class of an object that came, class needed) -> where the one has the other
OF_A_FALL = ("start", "velocity", "gravity")  # keywords for `Motion.base_position` that writers and viewers forward
_IDENTITY = np.eye(3)
_IDENTITY.flags.writeable = False


def made_by(call: str = "", **inside: str) -> Callable[[type[Made]], type[Made]]:
    """Return a decorator that registers, for messages, the call that makes an object of a class.

    inside : name of another class -> attribute of this class that holds an object of it
    """

    def registered(cls: type[Made]) -> type[Made]:
        _MADE_BY[cls.__name__] = call
        _INSIDE.update({(cls.__name__, kind): where for kind, where in inside.items()})
        return cls

    return registered


def check_object(value: object, kind: str, name: str, *, or_kind: str = "", call: str = "") -> None:
    """Raise WrongObjectError where an argument is not of our class `kind`, nor of `or_kind`.

    The message ends with the way to make one: `call`, or what `made_by` has registered.
    """
    names = [parent.__name__ for parent in type(value).__mro__]
    if kind in names or or_kind in names:
        return
    came = type(value).__name__
    shown = value_text(value) if isinstance(value, type) else f"{article(came)} {came}"
    remedy = _INSIDE.get((came, kind)) or f"make it with {call or _MADE_BY.get(kind) or f'{kind}(...)'}"
    raise WrongObjectError(f"{name}: {article(kind)} {kind} is needed, got {shown}; {remedy}")


def check_function(value: object, name: str, what: str) -> None:
    """Raise WrongObjectError where an argument is not a function; `what` describes the function."""
    if not callable(value) or isinstance(value, type):
        raise WrongObjectError(f"{name}: {what} is needed, got {value_text(value)}")


def check_executor(value: object) -> None:
    """Raise WrongObjectError where an argument is neither an executor of `concurrent.futures` nor None."""
    if value is not None and not (callable(getattr(value, "map", None)) and callable(getattr(value, "submit", None))):
        raise WrongObjectError(
            "executor: one of concurrent.futures, or of a cluster (client.get_executor()), is needed, got "
            f"{value_text(value)}"
        )


def check_keywords(given: Iterable[str], function: Callable[..., object], others: Iterable[str] = OF_A_FALL) -> None:
    """Raise WrongObjectError for an unknown keyword of a public function that forwards keywords.

    given : the keywords that it forwards
    others : valid ones among them
    """
    own = [name for name, part in list(signature(function).parameters.items())[1:] if part.kind != part.VAR_KEYWORD]
    for name in given:
        if name not in others:
            raise WrongObjectError(str(unknown_name(f"argument of {function.__name__}", name, [*own, *others])))


def check_choice(value: object, kind: str, choices: Collection[str]) -> None:
    """Raise UnknownNameError where an argument is not one of some words; `kind` describes the argument."""
    if not isinstance(value, str) or value not in choices:
        raise unknown_name(kind, value, choices)  # type: ignore[arg-type]


def check_flag(value: object, name: str, *, allow_none: bool = False) -> None:
    """Raise ShapeError where an argument is not True or False (or None, where that is allowed)."""
    if not isinstance(value, bool | np.bool_) and not (allow_none and value is None):
        choices = "True, False or None" if allow_none else "True or False"
        raise ShapeError(f"{name}: {choices} is needed, got {value_text(value)}")


def check_pair(value: object, name: str, what: str) -> None:
    """Raise ShapeError where an argument is not a pair; `what` describes its entries."""
    if not isinstance(value, tuple | list | np.ndarray) or len(value) != 2:
        raise ShapeError(f"{name}: {what} are needed, got {value_text(value)}")


def check_file_name(value: object, name: str) -> None:
    """Raise WrongObjectError where an argument is not the name of a file."""
    if not isinstance(value, str | os.PathLike):
        raise WrongObjectError(f"{name}: the name of a file is needed, got {value_text(value)}")


def check_text(value: object, name: str, what: str) -> None:
    """Raise WrongObjectError where an argument is not a text; `what` describes the text."""
    if not isinstance(value, str):
        raise WrongObjectError(f"{name}: {what} is needed, got {value_text(value)}")


def check_mapping(value: object, name: str, what: str) -> None:
    """Raise ShapeError where an argument is not a mapping; `what` describes keys and values."""
    if not isinstance(value, Mapping):
        raise ShapeError(f"{name}: a mapping, {what}, is needed, got {value_text(value)}")


def names_argument(value: object, name: str, what: str) -> tuple[str, ...]:
    """Return a user's names as a tuple. Raises ShapeError for a single text, and for other entries than texts."""
    names = None if isinstance(value, str) or not isinstance(value, Iterable) else tuple(value)
    if names is None or not all(isinstance(one, str) for one in names):
        raise ShapeError(f"{name}: {what} are needed, got {value_text(value)}")
    return names


def whole_argument(value: object, name: str, least: int) -> int:
    """Return a user's whole number, `least` or more. Raises ShapeError."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ShapeError(f"{name}: a whole number, {least} or more, is needed, got {value_text(value)}")
    return int(value)


def number_argument(value: ArrayLike, name: str, unit: str = "") -> float:
    """Return a user's finite number. Raises ShapeError."""
    number = finite_array(value, name, unit=unit)
    if number.ndim:
        raise ShapeError(f"{name}: one number{f' [{unit}]' if unit else ''} is needed, got shape {number.shape}")
    return float(number)


def times_argument(t: ArrayLike, duration: float) -> Array:
    """Return a user's times, within [0, duration] to rounding: (...) -> (...) [s]. Raises TrajectoryError."""
    times = finite_array(t, "t", unit="s")
    slack = _TIME_SLACK * duration
    if times.size and (times.min() < -slack or times.max() > duration + slack):
        outside = times.min() if times.min() < -slack else times.max()
        raise TrajectoryError(f"time {outside:.9g} s lies outside the motion's [0, {duration:.9g}] s")
    return np.clip(times, 0.0, duration)


def breaks_argument(breaks: ArrayLike, duration: float) -> Array:
    """Return a user's interior breaks and the two ends: (M,) -> (M + 2,) ascending [s]. Raises TrajectoryError."""
    inner = finite_array(breaks, "breaks", (None,), unit="s")
    if inner.ndim != 1:
        raise ShapeError(f"breaks: (M,) times are needed, got shape {inner.shape}")
    if np.any((inner < 0.0) | (inner > duration)):
        raise TrajectoryError(f"breaks must lie in [0, {duration:.9g}] s, got {value_text(inner)}")
    return np.unique(np.concatenate([[0.0], inner, [duration]]))


def positive_argument(value: float, name: str = "duration", unit: str = "a time in s") -> float:
    """Return a user's number above 0, of a size that does not overflow. Raises TrajectoryError, ShapeError."""
    number = finite_array(value, name)
    if number.ndim or number <= 0.0:
        raise TrajectoryError(f"{name}: {unit} above 0 is needed, got {value_text(value)}")
    if not LEAST_SIZE <= number <= LARGEST_SIZE:
        raise TrajectoryError(
            f"{name}: {unit} from {LEAST_SIZE:g} to {LARGEST_SIZE:g} is needed, got {value_text(value)}"
        )
    return float(number)


def check_time_steps(times: Array, where: str = "") -> None:
    """Raise TrajectoryError for ascending times (N,) [s] whose steps or sum overflow; `where` begins the message."""
    steps = np.diff(times)
    if not (np.all(steps >= LEAST_SIZE) and times[-1] - times[0] <= LARGEST_SIZE):
        raise TrajectoryError(
            f"{where}times: steps of {LEAST_SIZE:g} s or more, over {LARGEST_SIZE:g} s or less, are needed; got "
            f"steps from {steps.min():.3g} s over {times[-1] - times[0]:.3g} s"
        )


def tolerance_argument(tolerance: float) -> float:
    """Return a user's tolerance of an attitude [rad]. Raises ShapeError outside 1e-13 to 1e-4."""
    if type(tolerance) is float and TIGHTEST_TOLERANCE <= tolerance <= LOOSEST_TOLERANCE:
        return tolerance
    goal = finite_array(tolerance, "tolerance", unit="rad")
    if goal.ndim or not TIGHTEST_TOLERANCE <= goal <= LOOSEST_TOLERANCE:
        raise ShapeError(
            f"tolerance: a number from {TIGHTEST_TOLERANCE:g} to {LOOSEST_TOLERANCE:g} rad is needed, got "
            f"{value_text(tolerance)}"
        )
    return float(goal)


def check_picklable(function: object, what: str) -> None:
    """Raise LocalFunctionError for a function that pickle cannot find by its name; `what` holds it.

    Picklers that take functions by value (cloudpickle, which joblib uses, and dill) accept it.
    """
    name = getattr(function, "__qualname__", "")
    if "<" not in name:
        return
    frame = sys._getframe()
    while (frame := frame.f_back) is not None:
        if not _BY_VALUE.isdisjoint(frame.f_globals.get("__name__", "").split(".")):
            return
    raise LocalFunctionError(
        f"{what} made of {name!r} cannot be pickled: another process would not find that function; define it at the "
        "top of a module, or save the motion"
    )


def threads_argument(threads: int | None) -> int | None:
    """Return a user's number of threads, at least one; None: one for each processor. Raises ShapeError."""
    return None if threads is None else whole_argument(threads, "threads", 1)


def inertia_argument(tensors: Array, times: Array | None = None) -> Array:
    """Return a user's tensors (N, 3, 3), made symmetric. Raises UnphysicalInertiaError, SingularInertiaError."""
    symmetric, skew = _symmetric(tensors)
    if skew:
        raise UnphysicalInertiaError(f"an inertia tensor must be symmetric; its entries differ by {skew:.3g} kg m^2")
    inverse_inertia(symmetric, times)
    return symmetric


def _symmetric(tensors: Array) -> tuple[Array, float]:
    """The symmetric parts, and how far entries are off them; 0 where that is rounding."""
    mirrored = np.swapaxes(tensors, -1, -2)
    skew = float(np.abs(tensors - mirrored).max(initial=0.0))
    return 0.5 * (tensors + mirrored), skew if skew > _ASYMMETRY * np.abs(tensors).max(initial=0.0) else 0.0


def moments_argument(moments: ArrayLike) -> Array:
    """Return a user's three positive principal moments: (3,) [kg m^2].

    Raises ShapeError if they are not three finite numbers, or the least is not above 1e-12 of the largest.
    """
    values = finite_array(moments, "moments", (3,), unit="kg m^2")
    if values.shape != (3,):
        raise ShapeError(f"moments: expected three principal moments (3,), got {values.shape}")
    if not values.min() > _LEAST_MOMENT_RATIO * values.max():
        raise ShapeError(
            "moments: three positive principal moments, the least above 1e-12 of the largest, are needed; got "
            f"{value_text(values)}"
        )
    return values.copy()


def inverse_inertia_argument(inertia: ArrayLike) -> Array:
    """Return the inverse of a user's inertia tensor: (..., 3, 3) -> (..., 3, 3).

    Raises
    ------
    ShapeError, SingularInertiaError
        If it is not symmetric to 1e-9 of its size, or not positive definite.
    """
    symmetric, skew = _symmetric(finite_array(inertia, "inertia", (3, 3), unit="kg m^2"))
    if skew:
        raise ShapeError(f"inertia: not symmetric, off by {skew:.3g} kg m^2")
    return inverse_inertia(symmetric)


def on_unphysical_argument(value: str) -> str:
    """Return a user's "allow", "warn" or "error". Raises UnknownNameError."""
    check_choice(value, "value of on_unphysical", ON_UNPHYSICAL)
    return value


def magnitude_argument(magnitude: float, *, allow_zero: bool = False) -> float:
    """Return a user's magnitude of the momentum [kg m^2/s]. Raises ShapeError."""
    number = finite_array(magnitude, "magnitude", unit="kg m^2/s")
    if number.ndim or number < 0.0 or (number == 0.0 and not allow_zero):
        allowed = "0 or more" if allow_zero else "above 0"
        raise ShapeError(f"magnitude: a number {allowed} kg m^2/s is needed, got {value_text(magnitude)}")
    return float(number)


def magnitudes_argument(magnitudes: ArrayLike) -> Array:
    """Return a user's magnitudes of the momentum, all growing or all falling: (N,) [kg m^2/s]. Raises ShapeError."""
    values = finite_array(magnitudes, "magnitudes", (None,), unit="kg m^2/s")
    steps = np.diff(values)
    if values.ndim != 1 or not len(values) or values.min() < 0.0 or not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        raise ShapeError(
            "magnitudes: numbers of 0 or more kg m^2/s, all growing or all falling, are needed, got "
            f"{value_text(magnitudes)}"
        )
    return values


def direction_argument(value: ArrayLike, name: str) -> Array:
    """Return a user's directions as unit vectors: (..., 3) -> (..., 3). Raises ShapeError."""
    directions = finite_array(value, name, (3,))
    largest = np.max(np.abs(directions), axis=-1, keepdims=True)
    if np.any(largest == 0.0):
        where = tuple(int(i) for i in np.argwhere(largest[..., 0] == 0.0)[0])
        raise ShapeError(f"{name}: entry {list(where)} is zero and has no direction")
    return so3.normalised(directions / largest)


def vector_argument(value: ArrayLike, name: str, length: int = 3, unit: str = "") -> Array:
    """Return a copy of a user's vector of this length. Raises ShapeError."""
    vector = finite_array(value, name, (length,), unit=unit).copy()
    if vector.ndim != 1:
        raise ShapeError(f"{name}: one vector ({length},) is needed, got {vector.shape}")
    return vector


def initial_state_arguments(momentum: ArrayLike, attitude: ArrayLike | None) -> tuple[Array, Array]:
    """Return a user's momenta and attitudes at the start, broadcast: batch + (3,) [kg m^2/s], batch + (3, 3).

    The default attitude is the identity. Raises ShapeError.
    """
    spatial = finite_array(momentum, "momentum", (3,), unit="kg m^2/s").copy()
    if spatial.size and np.abs(spatial).max() > _LARGEST_MOMENTUM:
        raise ShapeError(
            f"momentum: {np.abs(spatial).max():.3g} kg m^2/s; at most {_LARGEST_MOMENTUM:g} can be squared"
        )
    if attitude is None:
        return spatial, np.broadcast_to(_IDENTITY, (*spatial.shape[:-1], 3, 3)) if spatial.ndim > 1 else _IDENTITY
    start = so3.rotation_argument(attitude, "attitude")
    batch = common_batch(momentum=spatial.shape[:-1], attitude=start.shape[:-2])
    return np.broadcast_to(spatial, (*batch, 3)), np.broadcast_to(start, (*batch, 3, 3))


def body_momentum_argument(momentum: ArrayLike, attitude: ArrayLike | None) -> Array:
    """Body angular momentum at the start, Pi = R^T momentum: (3,) [kg m^2/s]. Raises ShapeError for a batch."""
    body = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    if attitude is not None:
        body = so3.apply(so3.transpose(so3.rotation_argument(attitude, "attitude")), body)
    if body.ndim != 1:
        raise ShapeError(
            f"momentum and attitude: bounds are of one motion, got a batch of {body.shape[:-1]}; compute them for each"
        )
    return body


def interval_argument(interval: tuple[float, float] | None, duration: float) -> tuple[float, float]:
    """Return start and end of a part of [0, duration]; None: all of it. Raises ShapeError."""
    if interval is None:
        return 0.0, duration
    try:
        start, end = (float(time) for time in interval)
    except (TypeError, ValueError):
        raise ShapeError(f"interval: two times, start and end [s], are needed, got {value_text(interval)}") from None
    if not 0.0 <= start < end <= duration * (1.0 + 1e-12):
        raise ShapeError(f"interval: 0 <= start < end <= {duration:.9g} s is needed, got ({start:.9g}, {end:.9g})")
    return start, min(end, duration)
