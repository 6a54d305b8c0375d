"""Oracles for the tests: the motion of a free body by other routes than the library's, sharing no code with it.

`pinocchio_motion` conserves angular momentum with Pinocchio's `ccrba` at the true attitude; `mujoco_motion` knows
nothing of conservation and integrates MuJoCo's floating-base dynamics with the joints prescribed (theory.md U10).
Both carry a quaternion of their own through SciPy's DOP853 at rtol = 1e-12. The rest are closed forms.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
import pinocchio as pin
from numpy.linalg import norm
from numpy.polynomial.legendre import leggauss, legint, legval, legvander
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.body.catalog import example_file
from support.long_runs import full_but
from support.places import ROBOTS

if TYPE_CHECKING:
    from support.floating_mujoco import FloatingMujoco

Array = NDArray[np.float64]
RTOL = 1e-12
# Of a panel of `collocated_attitude`: a method of order 28.
_GAUSS_POINTS = 14
# Each gains more than a digit.
_MOST_ITERATIONS = 60
_NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])

# A momentum for each body [kg m^2/s] that turns it by about a turn in the two seconds of `random_loop`.
BODIES = {
    "example:human": 8.0,
    "astronaut": 8.0,
    "cat": 0.05,
    "cat_two_halves": 0.02,
    "diver": 10.0,
    "satellite": 12.0,
}
EVERY_BODY = full_but(BODIES, "example:human", "cat_two_halves", "satellite")
"""Parameters of a test; the other bodies differ from these in numbers only."""


class JointMotion(Protocol):
    """Joint coordinates and rates at one time."""

    @property
    def duration(self) -> float: ...
    def shape(self, t: float, /) -> Array: ...
    def rate(self, t: float, /) -> Array: ...


@dataclass(frozen=True)
class FourierLoop:
    """r = mean + spin t + sum_k a_k cos(2 pi k t/T) + b_k sin(2 pi k t/T), with its first two derivatives.

    `spin` is for joints that turn without end.
    """

    mean: Array
    cosines: Array
    sines: Array
    duration: float
    spin: float | Array = 0.0

    @cached_property
    def path(self) -> sp.ShapePath:
        """The same motion for the library."""
        if np.any(self.spin):
            return sp.ShapePath.function(lambda t: self.at(t), self.duration)
        return sp.ShapePath.fourier(self.mean, self.cosines, self.sines, self.duration)

    def at(self, times: Array) -> tuple[Array, Array]:
        """Shapes and rates at times (N,)."""
        return np.array([self.shape(t) for t in times]), np.array([self.rate(t) for t in times])

    def shape(self, t: float) -> Array:
        return self.mean + self.spin * t + self._derivative(t, 0)

    def rate(self, t: float) -> Array:
        return self.spin + self._derivative(t, 1)

    def acceleration(self, t: float) -> Array:
        return self._derivative(t, 2)

    def _derivative(self, t: float, order: int) -> Array:
        frequency = 2.0 * np.pi / self.duration * np.arange(1, self.cosines.shape[1] + 1)
        # Each derivative turns the phase by a quarter.
        phase = frequency * t + 0.5 * np.pi * order
        return self.cosines @ (frequency**order * np.cos(phase)) + self.sines @ (frequency**order * np.sin(phase))


def random_loop(seed: int, joints: int, *, size: float = 0.5, duration: float = 2.0, harmonics: int = 3) -> FourierLoop:
    """A closed loop with `harmonics` harmonics, the amplitudes of the higher ones smaller."""
    random = np.random.default_rng(seed)
    decay = size / np.arange(1, harmonics + 1)
    return FourierLoop(
        random.uniform(-0.3, 0.3, joints),
        decay * random.uniform(-1.0, 1.0, (joints, harmonics)),
        decay * random.uniform(-1.0, 1.0, (joints, harmonics)),
        duration,
    )


@lru_cache(maxsize=16)
def body_of(name: str) -> sp.Body:
    return sp.load_body(name)


def random_vector(seed: int, size: float) -> Array:
    vector = np.random.default_rng(seed).normal(size=3)
    return size * vector / np.linalg.norm(vector)


def random_rotation(seed: int) -> Array:
    return Rotation.random(rng=np.random.default_rng(seed)).as_matrix()


def hat(v: ArrayLike) -> Array:
    x, y, z = np.asarray(v, dtype=float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: ArrayLike, b: ArrayLike) -> Array:
    """The product of two vectors (3,): for equations of motion, where `np.cross` takes ten times as long."""
    a1, a2, a3 = np.asarray(a).tolist()
    b1, b2, b3 = np.asarray(b).tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def to_base(quat_xyzw: ArrayLike, vector: ArrayLike) -> Array:
    """R^T v of a unit quaternion: v + w t + t x q with t = 2 v x q."""
    x, y, z, w = np.asarray(quat_xyzw).tolist()
    a, b, c = np.asarray(vector).tolist()
    p, q, r = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    return np.array([a + w * p + q * z - r * y, b + w * q + r * x - p * z, c + w * r + p * y - q * x])


def quaternion_rate(quat_xyzw: ArrayLike, omega: ArrayLike) -> list[float]:
    """q' of R' = R hat(omega)."""
    x, y, z, w = np.asarray(quat_xyzw).tolist()
    i, j, k = np.asarray(omega).tolist()
    return [
        0.5 * (w * i + y * k - z * j),
        0.5 * (w * j + z * i - x * k),
        0.5 * (w * k + x * j - y * i),
        -0.5 * (x * i + y * j + z * k),
    ]


def turn(axis: ArrayLike, angle: float) -> Array:
    """The rotation by `angle` about `axis` (Rodrigues), of any length."""
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    k = hat(unit)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def apart(first: Array, second: Array) -> float:
    """The largest angle between two (stacks of) rotations [rad], exact to rounding for small angles."""
    difference = np.asarray(first) - np.asarray(second)
    # |A - B|_F = 2 sqrt(2) sin(angle/2) for rotations.
    norm = np.sqrt(np.sum(difference**2, axis=(-1, -2))) / (2.0 * np.sqrt(2.0))
    return float(np.max(2.0 * np.arcsin(np.minimum(norm, 1.0))))


def assert_within(found: ArrayLike, expected: ArrayLike, tolerance: float | Array) -> None:
    """Every entry is right to an absolute tolerance."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)  # type: ignore[arg-type]


def wrapped(angle: ArrayLike) -> Array:
    """An angle modulo 2 pi, nearest to zero."""
    return np.angle(np.exp(1j * np.asarray(angle, dtype=float)))


def geodesic_turn(start: Array, end: Array) -> Array:
    """The least rotation that takes one unit vector to another (not opposite) one."""
    k = hat(np.cross(start, end))
    return np.eye(3) + k + k @ k / (1.0 + start @ end)


def urdf_file(name: str) -> Path:
    """The file of a catalog name, or of "example:human"."""
    return example_file(name.removeprefix("example:")) if name.startswith("example:") else ROBOTS / f"{name}.urdf"


# ---- Pinocchio: momentum conserved at the true attitude -------------------------------------------------------------


@lru_cache(maxsize=16)
def free_flyer_model(name: str) -> pin.Model:
    return pin.buildModelFromUrdf(str(urdf_file(name)), pin.JointModelFreeFlyer())


class FreeFloating:
    """A Pinocchio model with a free-flyer, and its momentum at any attitude."""

    def __init__(self, name: str, joint_names: Sequence[str]) -> None:
        self.model = free_flyer_model(name)
        self.data = self.model.createData()
        joints = [self.model.joints[self.model.getJointId(joint)] for joint in joint_names]
        self.position = np.array([joint.idx_q for joint in joints])
        self.velocity = np.array([joint.idx_v for joint in joints])
        self.endless = np.array([joint.nq == 2 for joint in joints])
        self._q, self._v = np.zeros(self.model.nq), np.zeros(self.model.nv)

    def rates(self, quat_xyzw: Array, shape: Array, rate: Array, momentum: Array) -> tuple[Array, Array]:
        """I^-1 Pi and I^-1 L_o, base axes [rad/s], from the momentum map at this attitude."""
        self._move(quat_xyzw, shape, rate)
        both = np.stack([momentum, self.data.hg.angular], axis=-1)
        solved = np.linalg.solve(self.data.Ag[3:, 3:6], both)
        return solved[:, 0], solved[:, 1]

    def inverses_and_drifts(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        """I^-1 and I^-1 L_o, base axes, which do not depend on the attitude: (N, 3, 3), (N, 3)."""
        inertia, internal = np.empty((len(shapes), 3, 3)), np.empty((len(shapes), 3, 1))
        for row, (shape, rate) in enumerate(zip(shapes, rates, strict=True)):
            self._move(_NO_TURN, shape, rate)
            inertia[row], internal[row, :, 0] = self.data.Ag[3:, 3:6], self.data.hg.angular
        inverses = np.linalg.inv(inertia)
        return inverses, (inverses @ internal)[:, :, 0]

    def _move(self, quat_xyzw: Array, shape: Array, rate: Array) -> None:
        q, v = self._q, self._v
        q[3:7] = quat_xyzw
        q[self.position] = shape
        if self.endless.any():
            q[self.position[self.endless]] = np.cos(shape[self.endless])
            q[self.position[self.endless] + 1] = np.sin(shape[self.endless])
        v[self.velocity] = rate
        pin.ccrba(self.model, self.data, q, v)


@dataclass(frozen=True)
class IndependentMotion:
    """Attitude and lift at `times`, and at the end the dynamic phases and solid angles in two gauges."""

    attitude: Array
    lift: Array
    dynamic_phase: dict[str, float]
    solid_angle: dict[str, float]
    gap: dict[str, float]


def pinocchio_motion(
    name: str,
    joint_names: Sequence[str],
    joints: JointMotion,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    times: ArrayLike | None = None,
    breaks: Sequence[float] = (),
) -> IndependentMotion:
    """One integration of everything: R, the lift U, theta_D, and tangent vectors carried along Pi/|Pi|.

    The solid angle is the turn of a tangent vector carried parallel round the curve, closed by a great circle
    (Gauss and Bonnet), known modulo 2 pi. Seen from the horizontal gauge Pi is U Pi and the rate is U I^-1 Pi.
    """
    body = FreeFloating(name, joint_names)
    spatial = np.asarray(momentum, dtype=float)
    size = float(np.linalg.norm(spatial))
    axis = spatial / size if size else np.zeros(3)
    start = np.eye(3) if attitude is None else np.asarray(attitude, dtype=float)
    first = start.T @ axis
    tangent = np.cross(first, np.eye(3)[np.argmin(np.abs(first))])
    tangent = tangent / (np.linalg.norm(tangent) or 1.0)

    def slope(t: float, y: Array) -> Array:
        quat, lift, in_base, in_lift = y[:4] / norm(y[:4]), y[4:13].reshape(3, 3), y[13:16], y[16:19]
        by_momentum, by_shape = body.rates(quat, joints.shape(t), joints.rate(t), spatial)
        omega = by_momentum - by_shape
        u = to_base(quat, axis)
        u_rate = cross(u, omega)
        v, v_rate = lift @ u, lift @ cross(u, by_momentum)
        return np.concatenate(
            [
                quaternion_rate(y[:4], omega),
                (-lift @ hat(by_shape)).ravel(),
                -(in_base @ u_rate) * u,
                -(in_lift @ v_rate) * v,
                [u @ omega, u @ by_momentum],
            ]
        )

    y = np.concatenate([Rotation.from_matrix(start).as_quat(), np.eye(3).ravel(), tangent, tangent, [0.0, 0.0]])
    wanted = np.linspace(0.0, joints.duration, 41) if times is None else np.asarray(times, dtype=float)
    values = np.empty((len(wanted), len(y)))
    edges = np.unique([0.0, *breaks, joints.duration])
    for left, right in pairwise(edges):
        inside = (wanted >= left) & (wanted <= right)
        run = solve_ivp(
            slope, (left, right), y, "DOP853", rtol=RTOL, atol=1e-14, max_step=(right - left) / 4, dense_output=True
        )
        assert run.success, run.message
        # Between two breaks there may be none.
        if inside.any():
            values[inside] = run.sol(wanted[inside]).T
        y = run.y[:, -1]
    end = Rotation.from_quat(y[:4]).as_matrix()
    lift = y[4:13].reshape(3, 3)
    directions = {"base": end.T @ axis, "horizontal": lift @ end.T @ axis}
    carried = {"base": y[13:16], "horizontal": y[16:19]}
    solid_angle, gap = {}, {}
    for gauge, last in directions.items():
        closed = geodesic_turn(last, first) @ carried[gauge] if size else tangent
        solid_angle[gauge] = float(np.arctan2(first @ np.cross(tangent, closed), tangent @ closed))
        gap[gauge] = float(np.linalg.norm(last - first))
    return IndependentMotion(
        Rotation.from_quat(values[:, :4]).as_matrix(),
        values[:, 4:13].reshape(-1, 3, 3),
        {"base": float(y[19]), "horizontal": float(y[20])},
        solid_angle,
        gap,
    )


@dataclass(frozen=True)
class CollocatedAttitude:
    """Attitudes (N, 3, 3) and how uncertain they are [rad]."""

    attitude: Array
    uncertainty: float


def collocated_attitude(
    name: str,
    joint_names: Sequence[str],
    at: Callable[[Array], tuple[Array, Array]],
    momentum: ArrayLike,
    attitude: Array,
    times: Array,
) -> CollocatedAttitude:
    """The attitude by Gauss collocation on Pinocchio's momentum, at times among which all breaks are.

    I and L_o are Pinocchio's at the Gauss points themselves, nothing is interpolated; the implicit equations of each
    panel are iterated to rounding. All is done twice, the second time on panels half as long, whose answer is returned;
    how far the two are apart is how uncertain the first is, let alone the second.

    Parameters
    ----------
    at : times (N,) -> joint coordinates and rates (N, n) each
    """
    body = FreeFloating(name, joint_names)
    coarse, fine = (_collocated(body, at, np.asarray(momentum), attitude, times, parts) for parts in (1, 2))
    return CollocatedAttitude(fine, apart(coarse, fine))


def _collocated(
    body: FreeFloating,
    at: Callable[[Array], tuple[Array, Array]],
    momentum: Array,
    attitude: Array,
    times: Array,
    parts: int,
) -> Array:
    gauss, _ = leggauss(_GAUSS_POINTS)
    # Integrals of the Lagrange polynomials from the panel's start to each Gauss point, and to the end.
    primitives = legint(np.eye(_GAUSS_POINTS), lbnd=-1.0)
    values_to_series = np.linalg.inv(legvander(gauss, _GAUSS_POINTS - 1))
    integrals = legval(np.append(gauss, 1.0), primitives).T @ values_to_series
    seen = _seen_from_base(momentum)
    quat = Rotation.from_matrix(attitude).as_quat()
    quats = [quat]
    for left, right in pairwise(times):
        shapes, speeds = at(np.linspace(left, right, 5)[1:-1])
        around = zip(*body.inverses_and_drifts(shapes, speeds), strict=True)
        fastest = max(norm(inverse, 2) * norm(momentum) + norm(drift) for inverse, drift in around)
        # A panel turns the body by one radian at most, or a little more.
        count = parts * max(2, int(np.ceil((right - left) * fastest)))
        edges = np.linspace(left, right, count + 1)
        half = 0.5 * (right - left) / count
        nodes = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * gauss).ravel()
        shapes, speeds = at(nodes)
        inverses, drifts = body.inverses_and_drifts(shapes, speeds)
        # I^-1 R^T mu of the products of the quaternion's parts, and half of I^-1 L_o, both times half a panel.
        turning = (half * seen @ inverses.transpose(0, 2, 1)).reshape(count, _GAUSS_POINTS, 16, 3)
        drifting = half * drifts.reshape(count, _GAUSS_POINTS, 1, 3)
        for by_momentum, by_shape in zip(turning, drifting, strict=True):
            stages = np.repeat(quat[None], _GAUSS_POINTS, axis=0)
            for _ in range(_MOST_ITERATIONS):
                moved = quat + integrals[:-1] @ _turned(stages, by_momentum, by_shape)
                change = np.abs(moved - stages).max()
                stages = moved
                if change < 4e-16:
                    break
            quat = quat + integrals[-1] @ _turned(stages, by_momentum, by_shape)
            quat = quat / norm(quat)
        quats.append(quat)
    return Rotation.from_quat(np.array(quats)).as_matrix()


def _turned(quats: Array, by_momentum: Array, by_shape: Array) -> Array:
    """q omega / 2, with omega = I^-1 R^T mu - I^-1 L_o from the products of the parts of q: (s, 4) -> (s, 4)."""
    products = (quats[:, :, None] * quats[:, None, :]).reshape(-1, 1, 16)
    omega = products @ by_momentum - by_shape
    return (quats[:, :, None] * omega).reshape(-1, 12) @ _HALF_PRODUCT


def _seen_from_base(momentum: Array) -> Array:
    """R^T mu as a form in the products of the parts of a quaternion xyzw: (16, 3)."""
    a, b, c = momentum
    form = np.zeros((3, 4, 4))
    # conj(q) mu q by its parts; the form is symmetric, so each mixed product has half of its coefficient.
    form[0] = [[a, b, c, 0.0], [b, -a, 0.0, -c], [c, 0.0, -a, b], [0.0, -c, b, a]]
    form[1] = [[-b, a, 0.0, c], [a, b, c, 0.0], [0.0, c, -b, -a], [c, 0.0, -a, b]]
    form[2] = [[-c, 0.0, a, -b], [0.0, -c, b, a], [a, b, c, 0.0], [-b, a, 0.0, c]]
    return form.reshape(3, 16).T


# q omega / 2 of the products of q's parts and omega's: (12, 4).
_HALF_PRODUCT = np.zeros((4, 3, 4))
for _part, _axis, _result, _sign in (
    *((3, k, k, 1.0) for k in range(3)),
    *((k, k, 3, -1.0) for k in range(3)),
    *((k, (k + 1) % 3, (k + 2) % 3, 1.0) for k in range(3)),
    *((k, (k + 2) % 3, (k + 1) % 3, -1.0) for k in range(3)),
):
    _HALF_PRODUCT[_part, _axis, _result] = 0.5 * _sign
_HALF_PRODUCT = _HALF_PRODUCT.reshape(12, 4)


# ---- MuJoCo: forces and accelerations, no conservation law ----------------------------------------------------------


@lru_cache(maxsize=8)
def mujoco_model(name: str):
    """A MuJoCo model of a URDF with a floating base and without drawing or gravity.

    MuJoCo wants every moving link to weigh something: links without mass get 1e-14 kg.
    """
    import mujoco

    return mujoco.MjModel.from_xml_string(floating_urdf(name))


def floating_urdf(name: str) -> str:
    """The URDF as MuJoCo reads it, with a floating base and without drawing or gravity."""
    root = ElementTree.parse(urdf_file(name)).getroot()
    for link in root.findall("link"):
        for kind in ("visual", "collision"):
            for element in link.findall(kind):
                link.remove(element)
    children = {joint.find("child").get("link") for joint in root.findall("joint")}  # type: ignore[union-attr]
    (base,) = {link.get("name") for link in root.findall("link")} - children
    ElementTree.SubElement(root, "link", name="inertial_frame")
    floating = ElementTree.SubElement(root, "joint", name="floating_base", type="floating")
    ElementTree.SubElement(floating, "parent", link="inertial_frame")
    ElementTree.SubElement(floating, "child", link=base or "")
    settings = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(
        settings,
        "compiler",
        fusestatic="true",
        discardvisual="true",
        balanceinertia="false",
        inertiafromgeom="false",
        boundmass="1e-14",
        boundinertia="1e-14",
    )
    ElementTree.SubElement(settings, "option", gravity="0 0 0")
    return ElementTree.tostring(root, encoding="unicode")


class MujocoBody:
    """A floating body in MuJoCo: velocities are (base velocity, world; base rate, base axes; joint rates)."""

    def __init__(self, name: str, joint_names: Sequence[str]) -> None:
        import mujoco

        self.mujoco, self.model = mujoco, mujoco_model(name)
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(joint) for joint in joint_names]
        self.position = np.array([int(np.ravel(joint.qposadr)[0]) for joint in joints])
        self.velocity = np.array([int(np.ravel(joint.dofadr)[0]) for joint in joints])
        self._base_axes = np.eye(6, self.model.nv)
        assert len(joint_names) == self.model.nv - 6

    def place(self, position: Array, attitude: Array, shape: Array) -> None:
        """Set the configuration and compute all that depends on it alone."""
        self.put(position, Rotation.from_matrix(attitude).as_quat(), shape)

    def put(self, position: Array, quat_xyzw: Array, shape: Array) -> None:
        """The same, by a quaternion of length 1."""
        qpos = self.data.qpos
        qpos[:3] = position
        qpos[3] = quat_xyzw[3]
        qpos[4:7] = quat_xyzw[:3]
        qpos[self.position] = shape
        self.mujoco.mj_fwdPosition(self.model, self.data)

    def move(self, velocity: Array, omega: Array, rate: Array) -> None:
        """Set the velocity and compute all that depends on it."""
        qvel = self.data.qvel
        qvel[:3] = velocity
        qvel[3:6] = omega
        qvel[self.velocity] = rate
        self.mujoco.mj_fwdVelocity(self.model, self.data)

    def full(self, base: ArrayLike, joints: ArrayLike) -> Array:
        vector = np.zeros(self.model.nv)
        vector[:6] = base
        vector[self.velocity] = joints
        return vector

    def mass_times(self, vector: Array) -> Array:
        result = np.zeros(self.model.nv)
        self.mujoco.mj_mulM(self.model, self.data, result, vector)
        return result

    def base_mass(self) -> Array:
        return np.array([self.mass_times(row)[:6] for row in self._base_axes])

    def carried(self, rate: ArrayLike) -> Array:
        """The base's momenta (6,) that the joints' rates carry."""
        return self.mass_times(self.full(np.zeros(6), rate))[:6]

    def base_force(self, bend: ArrayLike) -> Array:
        """What would keep the base from accelerating while the joints do (6,)."""
        return self.data.qfrc_bias[:6] + self.carried(bend)

    def momentum_about_centre(self) -> Array:
        """Angular momentum about the centre of mass, world axes, as MuJoCo sums it over the links."""
        self.mujoco.mj_subtreeVel(self.model, self.data)
        return self.data.subtree_angmom[1].copy()

    def centre_of_mass(self) -> Array:
        return self.data.subtree_com[1].copy()


@dataclass(frozen=True)
class SimulatedMotion:
    """Attitude (N, 3, 3), position of the base origin (N, 3), angular velocity in base axes (N, 3)."""

    attitude: Array
    position: Array
    angular_velocity: Array


def mujoco_motion(
    name: str,
    joint_names: Sequence[str],
    loop: FourierLoop,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    times: ArrayLike | None = None,
) -> SimulatedMotion:
    """The motion from M a + bias = 0 on the base, joints as prescribed.

    The centre of mass starts at rest at the origin; the momentum enters only through the initial velocity.
    """
    return simulated_motion(MujocoBody(name, joint_names), loop, momentum, attitude, times)


def simulated_motion(
    body: MujocoBody | FloatingMujoco,
    loop: FourierLoop,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    times: ArrayLike | None = None,
) -> SimulatedMotion:
    """The same of a body that is made."""
    start = np.eye(3) if attitude is None else np.asarray(attitude, dtype=float)
    body.place(np.zeros(3), start, loop.shape(0.0))
    position = -body.centre_of_mass()
    body.place(position, start, loop.shape(0.0))
    # Of the base's six generalised momenta the last three are angular, about the base origin in base axes: without
    # linear momentum that is the momentum about the centre of mass.
    wanted = np.concatenate([np.zeros(3), start.T @ np.asarray(momentum, dtype=float)])
    velocity = np.linalg.solve(body.base_mass(), wanted - body.carried(loop.rate(0.0)))

    def slope(t: float, y: Array) -> Array:
        quat = y[3:7]
        body.put(y[:3], quat / norm(quat), loop.shape(t))
        body.move(y[7:10], y[10:13], loop.rate(t))
        force = body.base_force(loop.acceleration(t))
        return np.concatenate(
            [
                y[7:10],
                quaternion_rate(quat, y[10:13]),
                np.linalg.solve(body.base_mass(), -force),
            ]
        )

    y = np.concatenate([position, Rotation.from_matrix(start).as_quat(), velocity])
    wanted_times = np.linspace(0.0, loop.duration, 41) if times is None else np.asarray(times, dtype=float)
    run = solve_ivp(
        slope, (0.0, loop.duration), y, "DOP853", rtol=RTOL, atol=1e-14, max_step=loop.duration / 20, dense_output=True
    )
    assert run.success, run.message
    values = run.sol(wanted_times).T
    return SimulatedMotion(Rotation.from_quat(values[:, 3:7]).as_matrix(), values[:, :3], values[:, 10:13])


# ---- A rigid body ----------------------------------------------------------------------------------------------------


def rigid_motion(
    inertia: ArrayLike, body_momentum: ArrayLike, times: Array, attitude: ArrayLike | None = None
) -> tuple[Array, Array]:
    """Pi (N, 3) and R (N, 3, 3) at ascending times from 0 on, by DOP853 on Euler's equations and a quaternion."""
    inverse = np.linalg.inv(inertia)

    def slope(_: float, y: Array) -> Array:
        omega = inverse @ y[:3]
        return np.concatenate([cross(y[:3], omega), quaternion_rate(y[3:], omega)])

    quat = _NO_TURN if attitude is None else Rotation.from_matrix(attitude).as_quat()
    start = np.concatenate([body_momentum, quat])
    run = solve_ivp(slope, (0.0, times[-1]), start, "DOP853", t_eval=times, rtol=3e-14, atol=1e-15)
    return run.y[:3].T, Rotation.from_quat(run.y[3:].T).as_matrix()


# ---- Closed forms ---------------------------------------------------------------------------------------------------


def axisymmetric_attitude(across: float, along: float, momentum: ArrayLike, attitude: Array, times: Array) -> Array:
    """R(t) of a rigid body with moments (across, across, along): precession about mu, spin about the body's z.

    R = exp(t mu/across) R_0 exp(t Pi_3 (1/along - 1/across) e_3).
    """
    spatial = np.asarray(momentum, dtype=float)
    size = np.linalg.norm(spatial)
    spin = (1.0 / along - 1.0 / across) * (attitude.T @ spatial)[2]
    return np.array([turn(spatial, size * t / across) @ attitude @ turn([0.0, 0.0, 1.0], spin * t) for t in times])
