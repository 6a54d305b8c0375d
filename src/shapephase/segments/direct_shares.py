"""Rate of an angle of one link as a sum over the momentum and the joints, and its integral.

    omega_T = I^-1 Pi - sum_j I^-1 J_j r_j' + sum over joints j between base and T of their own axes times r_j',

each term times the row of the chart that turns an angular velocity into the rate of an angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import legendre

from .. import so3
from ..arguments import vector_argument
from ..arrays import Array, Integers
from ..body.body import Body
from ..body.link_motions import link_motions
from ..deformation.deformation import Deformation
from ..deformation.descriptions import ArticulatedDescription
from ..deformation.rotors import Rotor, RotorDescription
from ..display import frozen
from ..error_bars.wheels_along import WheelsAlong, reduced_chain, wheel_frames
from ..errors import AccuracyNotReached, ChartPoleError, WrongObjectError
from ..integrator.stepped import SteppedRotation
from ..reconstruction.attitude_angles import EulerAngles, continued_angles, followed
from ..reconstruction.reconstruction import Motion
from ..refinement import least_over
from ..shape_space.path_series import panel_edges
from ..shape_space.shape_path import ShapePath

STEEP = np.radians(85.0)  # tilt from which shares of the chart's angles are refused: they grow as 1/cos of the tilt
ANGLES = ("somersault", "tilt", "twist")
_NAMED = {sign + axis: float(f"{sign}1") * np.eye(3)[k] for sign in ("", "-") for k, axis in enumerate("xyz")}
_NODES = 12  # of Gauss on a panel: 1e-12 of smooth motions that turn by a radian there
_NEAR = 0.05  # of the attitude's tolerance, for the error of the quadrature
_ROUNDING = 1e-12  # of the largest rate: what rounding of attitudes leaves of the last terms
_MOST_HALVED = 20  # times: panels of 1e-6 of their first length
_PARTS = 8  # of a step, at which angles of a link other than the base are continued: joints turn it more


@frozen
class LinkChart:
    """Somersault, tilt and twist of one link of a body, Rotation = there Ry(somersault) Rx(tilt) Rz(twist) here^T.

    link : name of the link, or "base"
    frame, pose : number of its frame in the chain and its axes there; of the base 0 and the identity
    here : (3, 3) columns to the front, to the left and up the body, axes of the link
    there : (3, 3) columns across the somersault's axis, along it and up, inertial axes
    """

    link: str
    frame: int
    pose: Array
    here: Array
    there: Array

    @classmethod
    def of(cls, motion: Motion, link: str, of_athlete: bool, **given: Any) -> LinkChart:
        """Return the chart of a link, by axes given in its own axes, else those of `Motion.athlete_axes`.

        Without an athlete's angles, all axes are those of the link and the laboratory.
        """
        body, path = articulated_parts(motion.deformation)
        body.link_pose(body.shape(), link)
        frame, pose = body.chain.link_frames[link]
        if frame in wheel_frames(body.chain, rotors_of(motion.deformation)):
            raise WrongObjectError(f"link: {link} is a wheel, whose angle no path gives; take the link that carries it")
        if not of_athlete:
            return cls(link, frame, pose[:3, :3], np.eye(3), np.eye(3))

        def width(times: Array) -> Array:
            moments = np.linalg.eigvalsh(motion.deformation.description.sample(times)[0])
            return moments[:, 0] / moments[:, 1]

        # Axes are those of the body at its straightest, as `Motion.athlete_axes` finds them.
        turn = pose[:3, :3]
        if frame:
            when = np.array([least_over(width, panel_edges(path))[1]])
            turn = _turns(body, *path.curve(when), frame)[0] @ turn
        own = {key: value for key, value in given.items() if value is not None}
        for key in {"lateral", "longitudinal"} & {*own} if frame else ():
            value = own[key]
            named = isinstance(value, str) and value in _NAMED
            own[key] = turn @ (_NAMED[str(value)] if named else vector_argument(value, key))
        axes = motion.athlete_axes(**own)
        here = turn.T @ np.stack([axes.frontal, axes.lateral, axes.longitudinal], axis=-1)
        there = np.stack([np.cross(axes.somersault, axes.up), axes.somersault, axes.up], axis=-1)
        return cls(link, frame, pose[:3, :3], here, there)

    def attitude(self, motion: Motion, times: Array) -> Array:
        """Attitudes of the link, to inertial axes: (N,) -> (N, 3, 3)."""
        base = _base_attitudes(motion, times)
        if not self.frame:
            return base @ self.pose
        body, path = articulated_parts(motion.deformation)
        return base @ _turns(body, *path.curve(times), self.frame) @ self.pose

    def angles(self, motion: Motion, times: Array) -> Array:
        """Somersault, tilt and twist, continuous in time: (N,) -> (N, 3) [rad]."""
        known = motion.solution.times
        if self.frame:
            ends = np.union1d(known, motion.deformation.breaks)
            known = np.append((ends[:-1, None] + np.diff(ends)[:, None] * np.arange(_PARTS) / _PARTS).ravel(), ends[-1])

        def quaternions(sampled: Array) -> Array:
            return so3.quat_from_matrix(self.there.T @ self.attitude(motion, sampled) @ self.here)[None]

        chart, error = EulerAngles("YXZ"), float(motion.error_estimate)
        curve = followed(quaternions, known, chart, error)
        return continued_angles(quaternions, curve, times, chart, error)[0]

    def rates(self, attitudes: Array, about: Array | None) -> tuple[Array, Array]:
        """Rows that turn angular velocities in link axes into rates of angles, and the sine of the tilt.

        (N, 3, 3) -> (N, 3, 3) for somersault, tilt and twist, or (N, 1, 3) for the turn about an inertial axis; (N,).
        """
        seen = self.there.T @ attitudes @ self.here
        along = -seen[:, 1, 2]
        if about is not None:
            return (about @ attitudes)[:, None], along
        level = np.maximum(np.sqrt(np.maximum(1.0 - along**2, 0.0)), 1e-12)
        sine, cosine = seen[:, 1, 0] / level, seen[:, 1, 1] / level
        zero, one = np.zeros_like(along), np.ones_like(along)
        across = np.stack([sine, cosine, zero], axis=-1) / level[:, None]
        rows = np.stack([across, np.stack([cosine, -sine, zero], axis=-1), along[:, None] * across], axis=1)
        rows[:, 2] += np.stack([zero, zero, one], axis=-1)
        return rows @ self.here.T, along


def _base_attitudes(motion: Motion, times: Array) -> Array:
    """`Motion.attitude`, read off at the ends of steps, where nothing has to be evaluated: (N,) -> (N, 3, 3)."""
    solution = motion.solution
    if not isinstance(solution, SteppedRotation):
        return motion.attitude(times)
    index = np.minimum(np.searchsorted(solution.times, times), len(solution.times) - 1)
    attitudes = motion.initial_attitude @ so3.matrix_from_quat(solution.quaternions[0, index])
    between = solution.times[index] != times
    if between.any():
        attitudes[between] = motion.attitude(times[between])
    return attitudes


def articulated_parts(deformation: Deformation) -> tuple[Body, ShapePath]:
    """Body and path of a deformation, on which wheels rest. Raises WrongObjectError without joints or in a gauge."""
    known = deformation.description
    if isinstance(known, RotorDescription):
        return known.platform, known.route
    if isinstance(known, ArticulatedDescription) and known.body.n_shape:
        return known.body, known.path
    raise WrongObjectError(
        f"motion: shares are those of joints, and {deformation.label} has none on a path; reconstruct "
        "articulated(body, path), without gauge"
    )


def rotors_of(deformation: Deformation) -> tuple[Rotor, ...]:
    """Wheels of a deformation."""
    known = deformation.description
    return known.rotors if isinstance(known, RotorDescription) else ()


def reduced_body(body: Body, rotors: tuple[Rotor, ...]) -> Body:
    """The body without the moments of wheels that keep their momentum, about their axles."""
    if not rotors:
        return body
    chain = reduced_chain(body.chain, rotors)
    return body.with_frame_inertias(chain.masses, chain.centres, chain.inertias)


def _turns(body: Body, shapes: Array, rates: Array, frame: int) -> Array:
    return link_motions(body.chain, shapes, rates).turns[:, frame]


@frozen
class DirectShares:
    """What the momentum and each joint did to an angle of a link, along the motion.

    Attributes
    ----------
    times : (N,) [s]
    sources : "momentum" and the J joints; the axes of one joint are one source, and a wheel does what its momentum does
    shares : (N, J + 1) of each up to each time; their sum is the angle less that at the start [rad]
    angle : (N,) the angle itself, followed in time, from 0 at the start [rad]
    error : (N,) estimate of the difference of sum and angle [rad]
    total : (J + 1,) shares up to the time for which the result is stated [rad]
    largest_tilt : of the link [rad], at the time `tilt_time` [s]; 0 for a rotation

    Examples
    --------
    >>> dive = sp.reconstruct(
    ...     sp.articulated(sp.load_body("diver"), sp.examples.MOTIONS["diver_twist"].path()), [0.0, 61.558831, 0.0]
    ... )
    >>> direct = sp.contributions(dive, of="tilt").direct
    >>> print(direct.sources, abs(direct.shares[-1].sum() - direct.angle[-1]) < 1e-8)
    ('momentum', 'left_shoulder_abduction', 'right_shoulder_abduction') True
    """

    times: Array
    sources: tuple[str, ...]
    shares: Array
    angle: Array
    error: Array
    total: Array
    largest_tilt: float
    tilt_time: float


@dataclass(frozen=True, eq=False)
class DirectRates:
    """Rates of an angle by source along a motion.

    motion, chart : of the link
    of : one of `ANGLES`, or "rotation" about the inertial axis `about`
    joints : columns of the shape by joint
    """

    motion: Motion
    chart: LinkChart
    of: str
    about: Array
    joints: dict[str, tuple[int, ...]]

    @cached_property
    def parts(self) -> tuple[Body, ShapePath]:
        """Body, its wheels reduced, and path."""
        body, path = articulated_parts(self.motion.deformation)
        return reduced_body(body, rotors_of(self.motion.deformation)), path

    def __call__(self, times: Array) -> tuple[Array, Array, Array]:
        """Rates by source, how fast an attitude error of one changes their sum, and the sine of the tilt.

        (N,) -> (N, J + 1), (N,) [rad/s], (N,).
        """
        body, path = self.parts
        shapes, rates = path.curve(times)
        members = np.zeros((body.n_shape, len(self.joints)))
        for joint, columns in enumerate(self.joints.values()):
            members[list(columns), joint] = 1.0
        inertia = body.locked_inertia(shapes)
        columns, rotors = body.momentum_matrix(shapes) * rates[:, None], rotors_of(self.motion.deformation)
        if rotors:
            wheels = WheelsAlong(body, rotors, times, shapes, rates)
            turned = [body.joint_index(rotor.joint) for rotor in rotors]
            columns[:, :, turned] = np.swapaxes(wheels.along[..., None] * wheels.axles, 1, 2)
        carried = columns @ members
        momentum = self.motion.body_momentum(times)
        turning = np.linalg.solve(inertia, np.concatenate([momentum[:, :, None], -carried], axis=-1))
        axes = np.broadcast_to(self.chart.pose, (len(times), 3, 3))
        if self.chart.frame:
            axes = _turns(body, shapes, rates, self.chart.frame) @ self.chart.pose
            for joint in range(len(self.joints)):
                alone = link_motions(body.chain, shapes, rates * members[:, joint]).spins[:, self.chart.frame]
                turning[:, :, joint + 1] += alone
        turning = so3.transpose(axes) @ turning
        attitudes = self.motion.attitude(times) @ axes
        about = self.about if self.of == "rotation" else None
        rows, along = self.chart.rates(attitudes, about)
        row = rows[:, 0 if about is not None else ANGLES.index(self.of)]
        spin = np.linalg.norm(turning.sum(axis=-1), axis=-1)
        # A turn of the body by delta changes Pi by Pi x delta, and the row by its derivative, at most 2/cos^2.
        least = np.linalg.eigvalsh(inertia)[:, 0]
        steepness = 1.0 if about is not None else 1.0 / np.maximum(1.0 - along**2, 1e-12)
        sensitive = (2.0 * spin + np.linalg.norm(momentum, axis=-1) / least) * steepness
        return np.einsum("ni,nij->nj", row, turning), sensitive, along


def direct_shares(rates: DirectRates, times: Array, at: float) -> DirectShares:
    """Return the integrals of the rates of an angle up to times (N,), and to one of them for which totals are stated.

    Raises ChartPoleError if the tilt of the link passes 85 degrees, where somersault and twist have no meaning.
    """
    motion = rates.motion
    edges = np.union1d(motion.solution.times, motion.deformation.breaks)
    left, right, values, sensitive, along, truncation = _resolved(rates, edges)
    tilt, when = _largest_tilt(rates, left, right, along)
    instants = np.append(times, at)
    panel = np.clip(np.searchsorted(left, instants, side="right") - 1, 0, len(left) - 1)
    place = 2.0 * (instants - left[panel]) / (right - left)[panel] - 1.0
    half = 0.5 * (right - left)
    shares = _integrals(values, half, panel, place)
    error = float(motion.error_estimate)
    drift = _integrals(sensitive[:, :, None], half, panel, place)[:, 0] * error
    quadrature = np.concatenate([[0.0], np.cumsum(truncation)])[panel + 1]
    if rates.of == "rotation":
        angle, ends = shares.sum(axis=1), 0.0
    else:
        followed = rates.chart.angles(motion, np.append(0.0, instants))[:, ANGLES.index(rates.of)]
        angle, ends = followed[1:] - followed[0], 2.0 * error / np.cos(tilt)
    rounding = 1e-14 * (np.abs(shares).sum(axis=1) + np.abs(angle)) * len(left)
    return DirectShares(
        times=times,
        sources=("momentum", *rates.joints),
        shares=shares[:-1],
        angle=angle[:-1],
        error=(quadrature + drift + ends + rounding)[:-1],
        total=shares[-1],
        largest_tilt=tilt,
        tilt_time=when,
    )


def _largest_tilt(rates: DirectRates, left: Array, right: Array, along: Array) -> tuple[float, float]:
    """Largest tilt at nodes of panels and its time; 0 for a rotation. Raises ChartPoleError beyond 85 degrees."""
    if rates.of == "rotation":
        return 0.0, 0.0
    panel, node = np.unravel_index(int(np.argmax(np.abs(along))), along.shape)
    when = float(left[panel] + 0.5 * (right - left)[panel] * (1.0 + _gauss()[0][node]))
    tilt = float(np.arcsin(min(1.0, abs(along[panel, node]))))
    if tilt > STEEP:
        raise ChartPoleError(
            f"the tilt of {rates.chart.link} reaches {np.degrees(tilt):.1f} degrees at {when:.4g} s; beyond 85 degrees "
            f"shares of {rates.of} have no meaning: take the rotation about an axis, of='rotation', or another link"
        )
    return tilt, when


def _gauss() -> tuple[Array, Array]:
    nodes, weights = legendre.leggauss(_NODES)
    return nodes, legendre.legvander(nodes, _NODES - 1) * weights[:, None] * (np.arange(_NODES) + 0.5)


def _resolved(rates: DirectRates, edges: Array) -> tuple[Array, ...]:
    """Panels, halved until their series are accurate: ends, values at nodes by panel, truncation errors."""
    goal = _NEAR * rates.motion.tolerance / rates.motion.duration
    nodes, transform = _gauss()
    left, right = edges[:-1], edges[1:]
    done: list[tuple[Array, ...]] = []
    largest = 0.0
    for _ in range(_MOST_HALVED):
        half = 0.5 * (right - left)
        times = (left + half)[:, None] + half[:, None] * nodes
        values, sensitive, along = (
            result.reshape(len(left), _NODES, *result.shape[1:]) for result in rates(times.ravel())
        )
        _largest_tilt(rates, left, right, along)
        series = np.einsum("pnj,nk->pkj", values, transform)
        tail = np.abs(series[:, -2:]).max(axis=(1, 2)) * 2.0 * half
        largest = max(largest, float(np.abs(series).max()))
        rough = tail > 2.0 * half * max(goal, _ROUNDING * largest)
        done.append((left[~rough], right[~rough], values[~rough], sensitive[~rough], along[~rough], tail[~rough]))
        if not rough.any():
            order = np.argsort(np.concatenate([panels[0] for panels in done]))
            return tuple(np.concatenate(parts)[order] for parts in zip(*done, strict=True))
        middle = (left + half)[rough]
        left, right = np.concatenate([left[rough], middle]), np.concatenate([middle, right[rough]])
    raise AccuracyNotReached(
        f"rates of the {rates.of} are rough at {left[0]:.6g} s, where panels of "
        f"{right[0] - left[0]:.2g} s do not resolve them; smooth the motion, or declare the break"
    )


def _integrals(values: Array, half: Array, panel: Integers, place: Array) -> Array:
    """Integrals from the start to places in panels: (P, n, j) at nodes, (P,), (N,), (N,) -> (N, j)."""
    _, transform = _gauss()
    series = np.einsum("pnj,nk->kpj", values, transform) * half[:, None]
    upto = np.concatenate([np.zeros((1, values.shape[-1])), np.cumsum(2.0 * series[0], axis=0)])
    primitive = legendre.legint(series, lbnd=-1.0, axis=0)
    within = legendre.legvander(place, len(primitive) - 1)
    return upto[panel] + np.einsum("nk,knj->nj", within, primitive[:, panel])
