"""The simulated logs of `robots/`; `python -m support.robot_logs`, in `tests/`, writes them anew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import shapephase as sp
from shapephase.arrays import Array
from support.places import ROBOTS

RPM = np.pi / 30.0  # [rad/s]
RATE = 25.0  # samples a second [Hz]


@dataclass(frozen=True)
class SimulatedLog:
    """A motion, and the sensors that record it.

    Attributes
    ----------
    path, motion : every joint is turned by the path, a wheel too: the truth needs no rotors
    wheel : joint of which the speed is recorded, in place of the angle
    noise : standard deviations of joints [rad or m], attitude [rad], gyro [rad/s]
    bias : (3,) of the gyro, base axes [rad/s]
    seed : of the noise
    about : lines at the head of the file
    """

    path: sp.ShapePath
    motion: sp.Motion
    wheel: str | None
    noise: tuple[float, float, float]
    bias: tuple[float, float, float]
    seed: int
    about: str

    def columns(self) -> dict[str, Array]:
        """Column -> samples; a joint that rests has no noise."""
        joints, attitude, gyro = self.noise
        rng = np.random.default_rng(self.seed)
        times = np.linspace(0.0, self.path.duration, round(self.path.duration * RATE) + 1)
        columns = {"time [s]": times}
        for name, angle, rate in zip(self.path.joint_names, self.path.shape(times).T, self.path.rate(times).T):
            noise = rng.normal(scale=joints, size=times.shape)
            if name == self.wheel:
                columns[f"{name} [rpm]"] = rate / RPM
            else:
                columns[name] = angle + noise * (np.ptp(angle) > 0.0)
        turned = self.motion.attitude(times) @ sp.so3.exp(rng.normal(scale=attitude, size=(*times.shape, 3)))
        omega = self.motion.angular_velocity(times) + self.bias + rng.normal(scale=gyro, size=(*times.shape, 3))
        columns |= dict(zip(("base_qx", "base_qy", "base_qz", "base_qw"), sp.so3.quat_from_matrix(turned).T))
        return columns | dict(zip(("gyro_x [rad/s]", "gyro_y [rad/s]", "gyro_z [rad/s]"), omega.T))

    def text(self) -> str:
        """The file; its last digit is below the noise."""
        columns = self.columns()
        digits = [{"[rpm]": 1, "[rad/s]": 6}.get(name.rpartition(" ")[2], 5) for name in columns]
        rounded = [np.round(column, places) + 0.0 for column, places in zip(columns.values(), digits)]
        rows = [",".join(f"{value:.8g}" for value in row) for row in zip(*rounded)]
        return "\n".join([*(f"# {line}" for line in self.about.splitlines()), ",".join(columns), *rows, ""])


def satellite_log() -> SimulatedLog:
    """The satellite's arm goes round while its wheel, about 2000 rpm, holds most of the momentum."""
    body, duration = sp.load_body("satellite"), 40.0
    mean, cosine, sine = np.zeros((3, body.n_shape))
    for joint, terms in {
        "arm_1": (0.2, 0.0, 0.9),
        "arm_2": (0.9, -0.5, 0.0),
        "arm_3": (-0.7, 0.3, 0.3),
        "arm_5": (0.4, 0.0, -0.5),
        "boom_extension": (0.5, -0.4, 0.0),
        "left_wing_drive": (0.1, 0.2, 0.0),
        "right_wing_drive": (0.1, 0.2, 0.0),
    }.items():
        mean[body.joint_index(joint)], cosine[body.joint_index(joint)], sine[body.joint_index(joint)] = terms
    once = 2.0 * np.pi / duration  # [rad/s]

    def turned(times: Array) -> tuple[Array, Array]:
        phase = once * times[:, None]
        shapes = mean + cosine * np.cos(phase) + sine * np.sin(phase)
        rates = once * (sine * np.cos(phase) - cosine * np.sin(phase))
        wheel = body.joint_index("wheel_spin")
        rates[:, wheel] = 2000.0 * RPM + 250.0 * RPM * np.sin(once * times)
        shapes[:, wheel] = 2000.0 * RPM * times + 250.0 * RPM / once * (1.0 - np.cos(once * times))
        return shapes, rates

    path = sp.ShapePath.function(turned, duration, joint_names=body.joint_names)
    deformation = sp.articulated(body, path)
    momentum = sp.momentum_from_rate(deformation, [0.002, -0.003, 0.005])
    return SimulatedLog(
        path=path,
        motion=sp.reconstruct(deformation, momentum, tolerance=1e-12),
        wheel="wheel_spin",
        noise=(1e-4, 1e-4, 2e-5),
        bias=(3e-5, -5e-5, 2e-5),
        seed=1,
        about="Simulated: satellite.urdf moves its arm, boom and wings, with its reaction wheel about 2000 rpm.\n"
        "Noise: joints 1e-4 rad or m, base (star tracker) 1e-4 rad, gyro 2e-5 rad/s and a constant bias.",
    )


def astronaut_log() -> SimulatedLog:
    """An astronaut circles both arms ten times while drifting."""
    path = sp.examples.astronaut_arm_circles().repeated(10)
    return SimulatedLog(
        path=path,
        motion=sp.reconstruct(sp.articulated(sp.load_body("astronaut"), path), [0.1, 0.2, -0.05], tolerance=1e-12),
        wheel=None,
        noise=(2e-3, 1e-4, 1e-4),
        bias=(2e-4, -1e-4, 3e-4),
        seed=2,
        about="Simulated: astronaut.urdf circles both arms ten times, with a little angular momentum.\n"
        "Noise: joints 2e-3 rad, base (star tracker) 1e-4 rad, gyro 1e-4 rad/s and a constant bias.",
    )


LOGS = {"satellite_log.csv": satellite_log, "astronaut_log.csv": astronaut_log}

if __name__ == "__main__":
    for name, log in LOGS.items():
        (ROBOTS / name).write_text(log().text(), encoding="utf-8")
