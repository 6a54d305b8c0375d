"""The worked examples of deforming bodies, each with its source, physical parameters and known answer.

Those of Cabrera's section 4.2: a body that grows as a whole, one with a symmetry axis, antennas, slow deformations; and
somebody walking in a spacecraft, the cat, the astronaut, the rigid body. At the start the body's axes are the inertial
ones.

A mass that moves out along one axis increases the moments about the other two axes, never the one about its own. The
paper's examples 4.4 and 4.5, taken as printed, are bodies that widen across the axis and shorten along it; they exist
as long as the triangle inequality holds (C-E13), and beyond it these functions refuse them. Both models are here.

Source: Cabrera 2006, section 4.2; theory.md F1 to F9.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_flag, check_object, moments_argument, number_argument
from ..arrays import Array
from ..body.loading import load_body
from ..body.particles.point_masses import ParticleBody, particle_body
from ..deformation.assemblies import assembly, moving_mass, rigid_part
from ..deformation.deformation import articulated, prescribed, rigid
from ..errors import ShapeError, TrajectoryError
from ..letters import value_text
from ..rigid_body.euler_top import EulerTop
from ..shape_space.shape_path import ShapePath
from ._closed_form_motions import (
    AxialMotion,
    Example,
    Scale,
    SteadyTurn,
    TimeReparametrisedRigid,
    clock_of,
    diagonal,
    first_time,
    momentum_argument,
    positive,
    pulsation,
)
from .scenarios import astronaut_arm_circles, astronaut_leg_swing, cat_righting, kane_scher
from .slow_deformation import slow_antenna

_HALF_TURN_CONE = 59.426458741516  # [degrees] half angle by which Kane and Scher's cat turns by exactly 180 degrees
_DEGREE = np.pi / 180.0
_CLOSING_STEPS = 5  # Newton's, from 0: a gap below 2e-15 in all shapes of the pentagon


def homothety(
    scale: Scale | None = None,
    *,
    inertia: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.5, 0.0), (0.0, 0.0, 2.0)),
    momentum: ArrayLike = (0.6, 0.5, 3.0),
    duration: float | None = None,
    breaks: ArrayLike = (),
) -> Example:
    """F1: a body that grows and shrinks as a whole, I = a(t)^2 I_0, L_o = 0.

    It moves as the rigid body with inertia I_0 in the time tau = int a^-2 dt, and its phase is the rigid one.

    Source: Cabrera 2006, example 4.3; theory.md F1.

    Parameters
    ----------
    scale : None: `pulsation()`
    inertia : (3, 3) I_0 [kg m^2]
    duration : [s]; None: until Pi is back, tau = the rigid period
    breaks : interior times where a derivative of the scale jumps [s]

    Raises
    ------
    TrajectoryError
        If Pi never comes back and no duration is given, or the clock does not belong to the scale.

    Examples
    --------
    >>> example = sp.examples.homothety()
    >>> motion = sp.reconstruct(example.deformation, example.momentum)
    >>> print(f"{np.abs(motion.body_momentum(1.0) - example.known.body_momentum(1.0)).max():.6f}")
    0.000000
    """
    if scale is not None:
        check_object(scale, "Scale", "scale")
    if duration is not None:
        duration = number_argument(duration, "duration", "s")
    growing = pulsation() if scale is None else scale
    top = EulerTop(inertia, momentum)
    span = top.period if duration is None else duration
    if np.isinf(span):
        raise TrajectoryError("momentum: Pi of the rigid body does not come back to its start; give a duration [s]")
    clock = clock_of(growing, positive(span, "duration", "s"))
    length = first_time(clock, top.period, top.period) if duration is None else duration
    deformation = prescribed(
        lambda t: growing.at(t)[:, None, None] ** 2 * top.inertia, None, length, breaks, on_unphysical="error"
    )
    phase, known = top.montgomery_phase if duration is None else None, TimeReparametrisedRigid(top=top, clock=clock)
    return Example(deformation=deformation, momentum=top.momentum, known=known, phase=phase, rigid=top)


def axial_as_printed(
    axial: float = 2.0,
    transverse: float = 1.5,
    *,
    expansion_rate: float = 0.02,
    momentum: ArrayLike = (3.0, 0.8, 0.6),
    duration: float | None = None,
    on_unphysical: str = "error",
) -> Example:
    """F2: moments (I_1 (1 + expansion_rate t), I_2, I_2), example 4.4 as printed.

    Pi moves as that of the rigid body with the inertia of the start, in the time
    int (1/I_1 − 1/I_2) dt / (1/I_1(0) − 1/I_2). After its first loop, at T, the phase is l T/I_2 modulo 2 pi, which is
    not the rigid one, l T_RB/I_2.

    Such a body gets wider and keeps its transverse moments by getting shorter; no body has I_1 > 2 I_2, where it
    would be flatter than flat (C-E13).

    Source: Cabrera 2006, example 4.4; theory.md F2, C-E13.

    Parameters
    ----------
    axial, transverse : I_1(0) and I_2 [kg m^2]
    expansion_rate : of I_1, relative, above 0 [1/s]
    momentum : (3,) with a part along axis 1
    duration : [s]; None: one loop of Pi
    on_unphysical : as for `prescribed`

    Examples
    --------
    >>> example = sp.examples.axial_as_printed()
    >>> print(example.deformation.inertia([0.0, 5.0])[:, 0, 0])  # 2 (1 + 0.02 t)
    [2.  2.2]
    """
    start, across = positive(axial, "axial", "kg m^2"), positive(transverse, "transverse", "kg m^2")
    rate = positive(expansion_rate, "expansion_rate", "1/s")
    return _axial(
        (lambda t: start * (1.0 + rate * t), lambda t: np.log1p(rate * t) / (rate * start)),
        (lambda t: np.full_like(t, across), lambda t: t / across),
        momentum,
        duration,
        on_unphysical,
    )


def axial_stretch(
    mass: float = 12.0,
    radius: float = 0.5,
    length: float = 1.0,
    *,
    speed: float = 0.1,
    momentum: ArrayLike = (3.0, 0.8, 0.6),
    duration: float | None = None,
) -> Example:
    """F2b: a uniform cylinder that gets longer along its axis 1: I_1 = m r²/2 stays, I_2 = I_3 = m (3 r² + h²)/12.

    With h = length + speed t the integral of 1/I_2 is an arctangent. Pi circles the axis at the rate
    Pi_1 (1/I_2 − 1/I_1), and after its first loop, at T, the phase is l int_0^T dt/I_2 modulo 2 pi.

    Source: Cabrera 2006, example 4.4, by what its text describes; theory.md F2b, C-E13.

    Parameters
    ----------
    mass, radius, length : [kg], [m], [m]
    speed : above 0 [m/s]
    momentum, duration : as for `axial_as_printed`

    Examples
    --------
    >>> example = sp.examples.axial_stretch()
    >>> print(example.deformation.inertia(0.0).diagonal().round(6))  # m r^2/2 and m (3 r^2 + h^2)/12
    [1.5  1.75 1.75]
    """
    weight, wide = positive(mass, "mass", "kg"), positive(radius, "radius", "m")
    first, rate = positive(length, "length", "m"), positive(speed, "speed", "m/s")
    along, width = 0.5 * weight * wide**2, np.sqrt(3.0) * wide

    def transverse_integral(t: Array) -> Array:
        angle = np.arctan2(rate * t * width, width**2 + first * (first + rate * t))
        return 12.0 * angle / (weight * rate * width)

    return _axial(
        (lambda t: np.full_like(t, along), lambda t: t / along),
        (lambda t: weight * (width**2 + (first + rate * t) ** 2) / 12.0, transverse_integral),
        momentum,
        duration,
        "error",
    )


def printed_antenna(
    axis: int,
    moments: ArrayLike | None = None,
    *,
    grown: float | None = None,
    momentum: ArrayLike | None = None,
    extension_time: float = 5.0,
    coast: float = 20.0,
    on_unphysical: str = "error",
) -> Example:
    """F3 and F4: the moment about axis 1 or 3 grows at a constant rate, the others stay: example 4.5 as printed.

    The energy Pi.I^-1 Pi/2 falls as long as the moment grows, at half Pi_k² times the rate of 1/I_k. With axis 3, the
    largest moment, Pi stays in its regime if it circles axis 3 at the start. With axis 1, the smallest, it can pass
    from circling axis 1 to circling axis 3; with the moments given here it does, although their order does not change.

    No body has a moment above the sum of the two others (C-E13): I_1 ends at I_2 + I_3 and I_3 at I_1 + I_2.

    Source: Cabrera 2006, example 4.5; theory.md F3, F4, C-E13.

    Parameters
    ----------
    axis : 1 or 3
    moments : (3,) at the start [kg m^2]; None: (1, 1.5, 2)
    grown : the moment at the end [kg m^2]; None: 1.45 about axis 1, 2.4 about axis 3
    momentum : (3,); None: (0.8, 0.1, 0.6) with axis 1, (0.3, 0.4, 0.9) with axis 3
    extension_time, coast : how long the moment grows, and how long the body is then rigid [s]
    on_unphysical : as for `prescribed`

    Raises
    ------
    ShapeError
        For another axis, or if the moment does not grow.

    Examples
    --------
    >>> certificate = sp.bounds.regime_certificate(sp.examples.printed_antenna(3).deformation, [0.3, 0.4, 0.9])
    >>> certificate.regime.name
    'ABOUT_LARGEST'
    """
    if not isinstance(axis, int | np.integer) or axis not in (1, 3):
        raise ShapeError(f"axis: 1 or 3 is needed, got {value_text(axis)}")
    usual, usual_momentum = (1.45, (0.8, 0.1, 0.6)) if axis == 1 else (2.4, (0.3, 0.4, 0.9))
    start = moments_argument((1.0, 1.5, 2.0) if moments is None else moments)
    end = start.copy()
    end[axis - 1] = positive(usual if grown is None else grown, "grown", "kg m^2")
    if end[axis - 1] <= start[axis - 1]:
        raise ShapeError(
            f"grown: above the moment at the start, {start[axis - 1]:g} kg m^2, is needed, got {value_text(grown)}"
        )
    return _extension(
        lambda share: start + (end - start) * share[:, None],
        usual_momentum if momentum is None else momentum,
        extension_time,
        coast,
        on_unphysical,
    )


def regime_crossing(coast: float = 20.0) -> Example:
    """E11, the paper's case 3: I_3 grows fast from 1.06 to 2.05 kg m^2, I_1 = 1 and I_2 = 1.05 kg m^2 are constant.

    Pi starts near axis 1. The energy falls from 0.48189 to 0.33610 J in the 0.2 s, through that of the separatrix,
    l²/(2 I_2) = 0.47619 J: Pi leaves axis 1 and circles axis 3. The moments end at the limit of the triangle
    inequality, a flat body: I_3 can grow as fast as one likes, but no further.

    Source: Cabrera 2006, section 4.1.1, case 3; theory.md E11 and section 6.

    Examples
    --------
    >>> example = sp.examples.regime_crossing(coast=1.0)
    >>> print(example.deformation.inertia([0.0, 1.0])[:, 2, 2].round(6))
    [1.06 2.05]
    """
    return printed_antenna(3, (1.0, 1.05, 1.06), grown=2.05, momentum=(0.6, 0.0, 0.8), extension_time=0.2, coast=coast)


def dipole_antenna(
    axis: int = 3,
    *,
    hub: ArrayLike = (1.0, 1.5, 2.0),
    tip_mass: float = 0.5,
    reach: float = 1.5,
    momentum: ArrayLike = (0.3, 0.4, 0.9),
    extension_time: float = 5.0,
    coast: float = 20.0,
) -> Example:
    """F4b: a physical antenna: two tip masses move out from the hub at constant speed, to both sides along an axis.

    Whatever the axis, the two other moments grow by 2 m x² and its own is constant; the energy falls here too. The
    largest moment, if it is that of the axis, becomes the smallest: the paper's conclusion for its example 4.5 holds
    for the printed model only. Along the axis of the smallest moment the order of the moments does not change.

    Source: theory.md F4b, C-E13.

    Parameters
    ----------
    axis : 1, 2 or 3
    hub : (3,) moments of the hub, with the tip masses at its centre [kg m^2]
    tip_mass : of each tip [kg]
    reach : distance of each tip mass from the centre at the end [m]
    extension_time, coast : as for `printed_antenna` [s]

    Raises
    ------
    ShapeError
        For another axis.

    Examples
    --------
    >>> example = sp.examples.dipole_antenna()
    >>> print(example.deformation.inertia([0.0, 5.0])[:, 0, 0].round(6))  # 1 + 2 * 0.5 * 1.5^2 in the end
    [1.   3.25]
    """
    if not isinstance(axis, int | np.integer) or axis not in (1, 2, 3):
        raise ShapeError(f"axis: 1, 2 or 3 is needed, got {value_text(axis)}")
    bare = moments_argument(hub)
    added = 2.0 * positive(tip_mass, "tip_mass", "kg") * positive(reach, "reach", "m") ** 2 * np.ones(3)
    added[axis - 1] = 0.0
    return _extension(lambda share: bare + added * share[:, None] ** 2, momentum, extension_time, coast, "error")


def furniture(
    duration: float = 20.0,
    *,
    hub_mass: float = 400.0,
    hub: ArrayLike = (300.0, 350.0, 500.0),
    mass: float = 80.0,
    radius: float = 2.0,
    height: float = 0.0,
    momentum: ArrayLike = (0.0, 0.0, 30.0),
) -> Example:
    """F6: somebody walks once round a circle about the centre of a rigid spacecraft, at constant speed: L_o != 0.

    With the reduced mass m = mass hub_mass/(mass + hub_mass) and p the position from the hub's own centre of mass,
    I = I_hub + m (p² 1 − p p^T) and L_o = m p x p'. If the walk is in the plane of axes 1 and 2 and the momentum along
    axis 3, the spacecraft turns about that axis alone, by (l duration − 2 pi m radius²)/(I_3 + m radius²): the second
    term is the holonomy, the same at every speed. Otherwise there is no closed form.

    Source: Cabrera 2006, example 2.2; theory.md F6.

    Parameters
    ----------
    duration : of the walk [s]
    hub_mass, hub : mass of the spacecraft [kg], its (3,) principal moments within the triangle inequality [kg m^2]
    mass, radius : what moves and how far from the centre [kg], [m]
    height : of the circle along axis 3 [m]

    Examples
    --------
    >>> example = sp.examples.furniture()
    >>> motion = sp.reconstruct(example.deformation, example.momentum)
    >>> print(f"{motion.body_momentum(20.0)[2]:.6f}")  # walking about the axis of the momentum
    30.000000
    """
    height = number_argument(height, "height", "m")
    moments, inner, outer = moments_argument(hub), positive(hub_mass, "hub_mass", "kg"), positive(mass, "mass", "kg")
    wide, walk_rate = positive(radius, "radius", "m"), 2.0 * np.pi / positive(duration, "duration", "s")
    spatial = momentum_argument(momentum)
    walk = ShapePath.fourier([0.0, 0.0, height], [[wide], [0.0], [0.0]], [[0.0], [wide], [0.0]], duration)
    deformation = assembly(rigid_part(inner, np.diag(moments)), [moving_mass(outer, walk)])
    if height or spatial[0] or spatial[1]:
        return Example(deformation=deformation, momentum=spatial)
    added = inner * outer / (inner + outer) * wide**2
    rate = (spatial[2] - added * walk_rate) / (moments[2] + added)
    known = SteadyTurn(momentum=spatial, angular_velocity=np.array([0.0, 0.0, rate]))
    return Example(deformation=deformation, momentum=spatial, known=known, turn=rate * duration)


def cat(halves: bool = False) -> Example:
    """F7: the cat rights itself at zero momentum, by 180 degrees: a realistic one, or Kane and Scher's (`halves`).

    Source: Kane and Scher 1969; `kane_scher`, `cat_righting`; theory.md F7 and section 7.

    Examples
    --------
    >>> example = sp.examples.cat(halves=True)
    >>> motion = sp.reconstruct(example.deformation, example.momentum)
    >>> print(f"{np.degrees(sp.so3.angle(motion.final_attitude)):.4f}")
    180.0000
    """
    check_flag(halves, "halves")
    if halves:
        deformation = articulated(load_body("cat_two_halves"), kane_scher(0.0, _HALF_TURN_CONE * _DEGREE))
    else:
        deformation = articulated(load_body("cat"), cat_righting())
    return Example(deformation=deformation, momentum=np.zeros(3), turn=np.pi)


def astronaut(legs: bool = False) -> Example:
    """F8: the astronaut pitches at zero momentum, 11.825049 degrees by circling the arms, 12.352775 by the legs.

    Source: `astronaut_arm_circles`, `astronaut_leg_swing`; theory.md F8.

    Examples
    --------
    >>> example = sp.examples.astronaut()
    >>> motion = sp.reconstruct(example.deformation, example.momentum)
    >>> print(f"{np.degrees(sp.so3.angle(motion.final_attitude)):.6f} degrees")
    11.825049 degrees
    """
    check_flag(legs, "legs")
    path, degrees = (astronaut_leg_swing(), 12.352775) if legs else (astronaut_arm_circles(), 11.825049)
    deformation = articulated(load_body("astronaut"), path)
    return Example(deformation=deformation, momentum=np.zeros(3), turn=degrees * _DEGREE)


def rigid_body(moments: ArrayLike = (1.0, 1.5, 2.0), momentum: ArrayLike = (0.6, 0.5, 1.2)) -> Example:
    """F9: a rigid body over one period of Pi, known in closed form; its phase is Montgomery's.

    Source: Cabrera 2006, examples 2.6 and 3.8; theory.md F9, D12, D17.

    Raises
    ------
    TrajectoryError
        If the momentum does not come back, so that there is no period.

    Examples
    --------
    >>> example = sp.examples.rigid_body()
    >>> motion = sp.reconstruct(example.deformation, example.momentum)
    >>> print(motion.body_momentum([0.0, motion.duration]).round(6))  # it closes
    [[0.6 0.5 1.2]
     [0.6 0.5 1.2]]
    """
    top = EulerTop.principal(moments, momentum)
    if not np.isfinite(top.period):
        raise TrajectoryError("momentum: Pi of this body does not come back, so there is no period to show")
    deformation = rigid(top.inertia, top.period)
    return Example(deformation=deformation, momentum=top.momentum, known=top, phase=top.montgomery_phase, rigid=top)


EXAMPLES: Mapping[str, Callable[[], Example]] = {
    "homothety": homothety,
    "axial_as_printed": axial_as_printed,
    "axial_stretch": axial_stretch,
    "antenna_along_1": lambda: printed_antenna(1),
    "antenna_along_3": lambda: printed_antenna(3),
    "regime_crossing": regime_crossing,
    "dipole_antenna": dipole_antenna,
    "slow_antenna": slow_antenna,
    "furniture": furniture,
    "cat": cat,
    "cat_two_halves": lambda: cat(halves=True),
    "astronaut": astronaut,
    "rigid_body": rigid_body,
}
"""Examples of the theory by name; a call makes one with its default parameters.

Examples
--------
>>> sp.examples.EXAMPLES["furniture"]().deformation.duration
20.0
"""


def linked_pentagon() -> ParticleBody:
    """Closed chain of five unit edges in a plane, with unit masses at its corners: any two numbers are a shape of it.

    The regular pentagon is the shape zero. Edge k points along 2 pi k/5 + Re(f exp(-4 pi i k/5) + c exp(-2 pi i k/5)),
    where f = 1.1 (a + i b)/sqrt(1 + a^2 + b^2) and c closes the chain. The loop of zero curvature turns it by
    28.15937237 degrees, the most for one round.

    Source: Tong and Dullin 2012, The equilateral pentagon at zero angular momentum.

    Examples
    --------
    >>> pentagon = sp.examples.linked_pentagon()
    >>> edges = np.diff(pentagon.positions([2.0, -0.5]), axis=0)
    >>> np.linalg.norm(edges, axis=1).round(12).tolist()
    [1.0, 1.0, 1.0, 1.0]
    """
    import casadi

    chart, free, closing = (casadi.SX.sym(name, 2) for name in ("chart", "free", "closing"))
    even = np.linspace(0.0, 2.0 * np.pi, 5, endpoint=False)
    slow, fast = (casadi.DM(np.stack([np.cos(f * even), np.sin(f * even)], axis=1)) for f in (1, 2))
    headings = even + fast @ free + slow @ closing
    edges = casadi.horzcat(casadi.cos(headings), casadi.sin(headings))
    gap = casadi.sum1(edges).T
    newton = casadi.Function("newton", [closing, free], [closing - casadi.solve(casadi.jacobian(gap, closing), gap)])
    inside, closed = 1.1 * chart / casadi.sqrt(1.0 + casadi.sumsqr(chart)), casadi.SX.zeros(2)
    for _ in range(_CLOSING_STEPS):
        closed = newton(closed, inside)
    corners = casadi.substitute(casadi.cumsum(edges), casadi.vertcat(free, closing), casadi.vertcat(inside, closed))
    places = casadi.Function("corners", [chart], [corners])
    return particle_body(np.ones_like(even), places, ["a", "b"], name="linked pentagon")


def _axial(
    axial: tuple[Callable[[Array], Array], Callable[[Array], Array]],
    transverse: tuple[Callable[[Array], Array], Callable[[Array], Array]],
    momentum: ArrayLike,
    duration: float | None,
    on_unphysical: str,
) -> Example:
    """A body with a symmetry axis, from its two moments and the integrals of their inverses."""
    spatial = momentum_argument(momentum)
    known = AxialMotion(momentum=spatial, axial=axial[1], transverse=transverse[1])
    ends = [float(moment(np.zeros(1))[0]) for moment in (axial[0], transverse[0])]
    top = EulerTop.principal([ends[0], ends[1], ends[1]], spatial)
    looped = duration is None
    length = first_time(lambda t: np.abs(known.azimuth(t)), 2.0 * np.pi, 1.0) if looped else duration

    def moments(times: Array) -> Array:
        across = transverse[0](times)
        return np.stack([axial[0](times), across, across], axis=-1)

    phase = float(top.magnitude * known.transverse(np.asarray(length))) if looped else None
    deformation = diagonal(moments, length, (), on_unphysical)
    return Example(deformation=deformation, momentum=spatial, known=known, phase=phase, rigid=top)


def _extension(
    moments: Callable[[Array], Array], momentum: ArrayLike, extension_time: float, coast: float, on_unphysical: str
) -> Example:
    """Moments as a function of the share of the extension, from 0 to 1 at a constant rate; then the body is rigid."""
    moving = positive(extension_time, "extension_time", "s")
    length = moving + positive(coast, "coast", "s")
    spatial = momentum_argument(momentum)
    deformation = diagonal(lambda t: moments(np.minimum(t / moving, 1.0)), length, (moving,), on_unphysical)
    rigid_start = EulerTop.principal(moments(np.zeros(1))[0], spatial)
    return Example(deformation=deformation, momentum=spatial, rigid=rigid_start)
