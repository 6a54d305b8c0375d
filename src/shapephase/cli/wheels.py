"""Wheels on the command line: `--wheel`, `--rotor` and `--rotor-speed`, and what is printed of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..body.body import Body
from ..deformation.deformation import Deformation, articulated
from ..deformation.rotors import Rotor, RotorDescription
from ..errors import ShapeError, TrajectoryError
from ..shape_space.files.labels import RPM, speed
from ..shape_space.files.read import RecordedMotion
from ..shape_space.shape_path import ShapePath
from .options import WheelOptions

_MAX_SHOWN = 60  # characters of a word that an error repeats


@dataclass(frozen=True)
class Wheels:
    """Wheels of a command by the names of their axles.

    momenta, speeds : kept or held [kg m^2/s], [rad/s]
    columns : of a recording, with speeds
    """

    momenta: dict[str, float] = field(default_factory=dict)
    speeds: dict[str, float] = field(default_factory=dict)
    columns: dict[str, str] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """All of them."""
        return [*self.momenta, *self.speeds, *self.columns]

    def deformation(self, body: Body, path: ShapePath, recorded: RecordedMotion | None) -> Deformation:
        """The deformation of a body with these wheels along a path of its other joints."""
        in_time = {} if recorded is None else recorded.wheel_speeds
        return articulated(body, path, rotors=self.momenta, rotor_speeds={**in_time, **self.speeds})


NO_WHEELS = Wheels()


def with_wheels(body: Body, options: WheelOptions) -> tuple[Body, Wheels]:
    """Return a body with the wheels that `--wheel` takes out of its base, and the wheels of all options.

    Raises UnknownNameError for an unknown joint; ShapeError for words of another form, or a wheel given twice or
    without what it stores.
    """
    numbers = " ".join(options.wheel).replace(",", " ").split()
    try:
        rows = [tuple(map(float, numbers[k : k + 4])) for k in range(0, len(numbers), 4)]
    except ValueError:
        rows = []
    if len(numbers) % 4 or len(rows) < len(numbers) // 4:
        raise ShapeError(
            '--wheel: its axis in axes of the base and its inertia in kg m^2 are needed, as in --wheel "0 0 1" 0.05, '
            f"got {' '.join(numbers)!r:.{_MAX_SHOWN}}"
        )
    made = [f"wheel_{number}" for number in range(1, len(rows) + 1)]
    for name, (*axis, inertia) in zip(made, rows, strict=True):
        body = body.with_wheel(axis, inertia, name=name)
    wheels = Wheels()
    for option, words in (("--rotor", options.rotor), ("--rotor-speed", options.rotor_speed)):
        for word in words:
            name, _, value = (text.strip() for text in word.partition("="))
            if not (name and value):
                example = "rw1=1.5" if option == "--rotor" else "rw1=6000rpm"
                raise ShapeError(
                    f"{option}: JOINT=VALUE is needed, as in {option} {example}, got {word!r:.{_MAX_SHOWN}}"
                )
            body.joint_index(name)
            if name in wheels.names:
                raise ShapeError(f"{option}: the wheel {name!r:.{_MAX_SHOWN}} is given twice; keep one value")
            if option == "--rotor":
                wheels.momenta[name] = momentum_word(value, name, option)
                continue
            known = speed_word(value, name, option)
            if known is None:
                wheels.columns[name] = value
            else:
                wheels.speeds[name] = known
    idle = [name for name in made if name not in wheels.names]
    if idle:
        raise ShapeError(
            f"--wheel: {idle[0]} stores nothing yet; give its momentum, --rotor {idle[0]}=1.5, or its speed, "
            f"--rotor-speed {idle[0]}=6000rpm"
        )
    return body, wheels


def momentum_word(text: str, name: str, option: str) -> float:
    """Return the momentum of a wheel [kg m^2/s]. Raises ShapeError."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ShapeError(f"{option}: {name}: a momentum in kg m^2/s is needed, as 1.5, got {text!r:.{_MAX_SHOWN}}")
    return value


def speed_word(text: str, name: str, option: str) -> float | None:
    """Return the speed of a wheel [rad/s]; None for a word that is no number. Raises ShapeError."""
    try:
        return speed(text, f"{option}: {name}")
    except TrajectoryError as error:
        raise ShapeError(str(error)) from None


def wheel_lines(deformation: Deformation) -> list[str]:
    """Return a line for each wheel: its momentum or speed, constant or in time, and what keeps it."""
    description = deformation.description
    return [_line(rotor) for rotor in description.rotors] if isinstance(description, RotorDescription) else []


def _line(rotor: Rotor) -> str:
    known = rotor.record
    ends = np.atleast_1d(known["momentum_kg_m2_s" if rotor.is_momentum else "speed_rad_s"])
    amounts = " to ".join(dict.fromkeys(f"{end:.6g}" for end in (ends if rotor.is_momentum else ends / RPM)))
    way = "given in time" if "in_time" in known else "kept, its motor off" if rotor.is_momentum else "held by its motor"
    unit = "kg m^2/s along its axle in space" if rotor.is_momentum else "rpm on its axle"
    return f"{rotor.joint}: {amounts} {unit}, {way}"
