"""Audits of flights of few samples, as video and suits have them: by a fit of the whole flight, without differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..deformation.deformation import articulated
from ..error_bars.recorded_momentum import momentum_from_recording
from ..errors import TrajectoryWarning
from ..shape_space.free_fall import centre_noise, measured_fall
from ..shape_space.shape_path import ShapePath
from ..warning_filters import quiet
from ._airborne import AirbornePart
from ._smooth_part import smooth_part
from .audit_result import RunAudit
from .floating_trajectory import FloatingTrajectory, TrajectoryNoise, estimated_noise

TOLD_APART = 24
"""Samples from which on rates by differences of samples say what noise has, and causes can be told apart."""
_BARS = 3.0  # standard deviations by which a momentum has to change


def short_run_audit(
    body: Body,
    run: FloatingTrajectory,
    part: AirbornePart,
    tolerance: float,
    wander: float,
    noise: TrajectoryNoise | None,
) -> RunAudit:
    """Momentum, its drift and the fall of a flight of few samples, with their standard deviations.

    Raises AccuracyNotReached if no flight of this body is near.

    run : the samples in the air
    tolerance : of the momentum relative to what turns the body
    wander : of the centre of mass [m], which widens that tolerance
    noise : of the samples; None: what they show
    """
    times = run.times - run.times[0]
    path = ShapePath.spline(times, run.shapes, periodic=False, joint_names=body.joint_names)
    with quiet(category=TrajectoryWarning):
        noise = noise or run.noise
        stated = None if noise is None or noise.attitude == 0.0 else noise.attitude
        fit = momentum_from_recording(articulated(body, path), times, run.attitude, noise=stated)
    samples_noise = replace(estimated_noise(run), attitude=fit.noise) if noise is None else noise
    shapes, rates = path.curve(times)[:2]
    inertia, internal = body.sample(shapes, rates)
    turning = so3.apply(so3.transpose(run.attitude), fit.momenta)
    scale = float(np.sqrt((turning**2 + internal**2).sum(axis=1).mean()))
    extent = float(np.sqrt(0.5 * np.trace(inertia, axis1=1, axis2=2).mean() / body.mass))
    drift = float(np.linalg.norm(fit.momenta - fit.momenta.mean(axis=0), axis=1).max())
    white = np.sqrt((fit.by_attitudes[3:6] ** 2).sum(axis=1)) * fit.noise * max(fit.widening, 1.0)
    level = float(np.linalg.norm(white))
    if scale > 0.0:
        tolerance = max(tolerance, 2.0 * np.pi / float(times[-1]) * body.mass * wander * extent / scale)
    fall, fall_bar, off = None, None, None
    if run.position is not None:
        centres = run.position + so3.apply(run.attitude, body.centre_of_mass(shapes))
        known = float(np.hypot(centre_noise(times, centres), samples_noise.position))
        fall_bar = measured_fall(times, centres, known)[1]
        fall = smooth_part(times, centres, np.tile(known**2 * np.eye(3), (len(times), 1, 1)), 3)
        off = float(np.linalg.norm(fall.values, axis=1).max())
    ratio = drift**2 / (_BARS * level) ** 2 if level > 0.0 else 0.0
    # Filtered noise is slow, and looks like a change of momentum; a constant one explains all but the stated noise.
    explained = stated is not None and float(np.sqrt(np.mean(fit.residuals**2))) <= stated
    right = explained or fit.conserved or ratio <= 1.0 or drift <= tolerance * scale
    right = right and (fall is None or off is None or fall.ratio <= 1.0 or off <= max(tolerance * extent, wander))
    return RunAudit(
        name=run.name,
        airborne=part,
        first_time=float(run.times[0]),
        last_time=float(run.times[-1]),
        given_rates=run.joint_rates is not None,
        step=run.assumed_step,
        noise=samples_noise,
        times=run.times,
        momentum=fit.momenta,
        momentum_scale=scale,
        momentum_drift=drift,
        momentum_noise=level / scale if scale > 0.0 else 0.0,
        momentum_ratio=ratio,
        fall_off=off,
        fall_ratio=None if fall is None else fall.ratio,
        extent=extent,
        agreement=None,
        attitude_error=fit.angles,
        tolerance=tolerance,
        recorded=wander > 0.0,
        right=bool(right),
        momentum_bars=_bars(fit.momentum_covariance),
        fall_bar=fall_bar,
    )


def _bars(covariance: Array) -> tuple[float, float, float]:
    x, y, z = np.sqrt(np.diag(covariance)).tolist()
    return x, y, z
