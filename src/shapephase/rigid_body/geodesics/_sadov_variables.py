"""Action and angle variables of the free rigid body (Sadov's), from Andoyer's, and its two frequencies.

The actions are J, the integral of L dl round the closed curve in the (l, L) plane over 2 pi, G and K. Their angles
advance evenly in free motion: that of J at `own_rate`, once round in a period of the momentum in the body; that of G
at `precession_rate`, the mean of g'; that of K, k itself, not at all. Body axes are principal.

g, l and L here belong to axes whose third is that of the smallest moment, I_1, and whose first is that of the largest,
I_3 (`SerretAndoyerMetric.andoyer_axes`); the papers number these moments in descending order. J does not depend on the
sense of the motion; it grows from 0, with the momentum along the axis of I_3, to G, along that of I_1. Where the
momentum circles the axis of I_3 or its opposite, angles count from l = pi/2 or -pi/2, L > 0; where it circles that of
I_1, from l = pi/2. Along the axis of I_3 the angle of J is undefined, along that of I_1 it follows from l.
`andoyer_from_sadov` goes the other way; the side of the axis on which the momentum is has to be given.

Two equal moments need no such variables: with the axis of symmetry as third, Andoyer's own variables are
angles and actions, l, g, k and L, G, K. By H = G²/(2 I_e) + L² (1/I_s − 1/I_e)/2 the rates are l' = L (1/I_s − 1/I_e)
and g' = G/I_e, I_s being the moment about that axis and I_e the equal ones; with three equal moments l' = 0.

Source: Sadov 1970; Bonnard, Cots and Shcherbakova 2013, introduction; theory.md R15. All from the geodesics of unit
speed by homogeneity: the action and the rates are sqrt(2 E) times theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import elliptic, so3
from ...arguments import check_object, moments_argument
from ...arrays import Array, Mask, common_batch, finite_array
from ...display import short_repr
from ...errors import ShapeError
from ...inertia_tensor import ascending_moments
from ...letters import value_text
from .._arguments import HALVINGS, check_entries
from ._andoyer_variables import AndoyerVariables, andoyer_variables
from .serret_andoyer import SerretAndoyerMetric, serret_andoyer_metric


@dataclass(frozen=True, eq=False)
class SadovVariables:
    """Actions, angles and frequencies, (...) each. Made by `sadov_variables`."""

    own: Array
    """Conjugate to `action` [rad]."""
    precession: Array
    """Conjugate to `total` [rad]; g without its oscillation."""
    node: Array
    """Andoyer's k, conjugate to `vertical` [rad]."""
    action: Array
    """J [kg m^2/s]."""
    total: Array
    """G [kg m^2/s]."""
    vertical: Array
    """K [kg m^2/s]."""
    own_rate: Array
    """dH/dJ: 2 pi over the period of the momentum in the body [rad/s]."""
    precession_rate: Array
    """dH/dG, the mean rate about the momentum [rad/s]."""

    __repr__ = short_repr


def sadov_variables(moments: ArrayLike, variables: AndoyerVariables) -> SadovVariables:
    """Action and angle variables of states in Andoyer's variables: (3,), (...) -> (...).

    Raises ShapeError if two moments are equal, or a state is on the separatrix or along the axis of the middle moment,
    where the period is infinite and there are no angles. Next to it they lose digits in proportion to 1/m1, m1 the
    complement of the elliptic modulus.

    Parameters
    ----------
    moments : (3,) about the body axes 1, 2, 3, in any order [kg m^2]
    variables : of a body with those axes

    Examples
    --------
    >>> state = sp.rigid_body.geodesics.andoyer_variables(np.eye(3), [1.5, 0.3, 0.4])
    >>> found = sp.rigid_body.geodesics.sadov_variables([3.0, 2.0, 1.0], state)
    >>> print(f"{found.total:.9f} {found.own_rate:.6f}")
    1.581138830 0.474919
    """
    check_object(variables, "AndoyerVariables", "variables")
    metric = _metric(moments)
    axes = metric.andoyer_axes
    if not np.array_equal(axes, np.eye(3)):
        variables = andoyer_variables(variables.attitude @ axes, variables.body_momentum @ axes)
        metric = _descending(metric)
    momentum = variables.body_momentum
    family = metric.geodesics_of(momentum)
    requirement = (
        "on the separatrix and along the axis of the middle moment the period is infinite and there are no angle "
        "variables; the action alone is `SerretAndoyerMetric.separatrix().action`"
    )
    check_entries(family.complement == 0.0, momentum, "variables", requirement)
    speed = np.sqrt(2.0 * variables.hamiltonian(np.diag(metric.moments)))
    u = _argument(metric.moments, momentum, variables.l, family.is_oscillating, family.complement)
    quarter = elliptic.complete_k(family.complement)
    whole = elliptic.complete_pi_excess(family.constants.characteristic, family.complement)
    part = elliptic.jacobi_and_pi_excess(family.constants.characteristic, u, family.complement)[4]
    return SadovVariables(
        own=so3.wrap(0.5 * np.pi * u / quarter),
        precession=so3.wrap(variables.g + family.constants.third_kind * (part - whole * (u / quarter))),
        node=variables.k,
        action=speed * family.action,
        total=variables.total,
        vertical=variables.vertical,
        own_rate=speed * 2.0 * np.pi / family.period,
        precession_rate=speed * 2.0 * family.first_return / family.period,
    )


def sadov_frequencies(moments: ArrayLike, body_momentum: ArrayLike) -> tuple[Array, Array]:
    """dH/dJ and dH/dG, the frequencies of free motion through these momenta: (3,), (..., 3) -> (...), (...) [rad/s].

    The rate at which the momentum goes round in the body, and the mean rate about the momentum; on the separatrix their
    limits, of which the first is 0. The moments, in any order, are those about the momenta's axes.

    Source: theory.md R15.
    Raises ShapeError if two moments are equal, or a momentum is zero.

    Examples
    --------
    >>> top = sp.EulerTop.principal([3.0, 2.0, 1.0], [1.5, 0.3, 0.4])
    >>> own, precession = sp.rigid_body.geodesics.sadov_frequencies([3.0, 2.0, 1.0], [1.5, 0.3, 0.4])
    >>> print(f"{own * top.period:.9f} = 2 pi")
    6.283185307 = 2 pi
    """
    metric = _metric(moments)
    momentum = finite_array(body_momentum, "body_momentum", (3,), unit="kg m^2/s")
    family = metric.geodesics_of(momentum)
    speed = np.sqrt(np.sum(momentum**2 / metric.moments, axis=-1))
    return speed * 2.0 * np.pi / family.period, speed * family.mean_theta_rate


def andoyer_from_sadov(
    moments: ArrayLike, angles: ArrayLike, actions: ArrayLike, side: ArrayLike = 1.0
) -> AndoyerVariables:
    """The states with these angle and action variables, in Andoyer's: (3,), (..., 3), (..., 3), (...) -> (...).

    The energy is found from J by bisection, as J grows with the angle of the momentum from the axis of the largest
    moment. Next to the separatrix angles lose digits as in `sadov_variables`.

    Source: Sadov 1970; theory.md R15.
    Raises ShapeError if two moments are equal, an action is out of range, a side is another number, or J is that of the
    separatrix.

    Parameters
    ----------
    moments : (3,) about the body axes 1, 2, 3, in any order [kg m^2]
    angles : (..., 3) those of J, G and K: `own`, `precession`, `node` of `sadov_variables` [rad]
    actions : (..., 3) J, G and K, 0 <= J <= G and |K| <= G [kg m^2/s]
    side : (...) 1 or -1: whether the momentum is on the positive side of the axis that it circles, which is that of
        the largest moment where J is below its value on the separatrix, and that of the smallest moment above

    Examples
    --------
    >>> state = sp.rigid_body.geodesics.andoyer_variables(np.eye(3), [1.5, 0.3, 0.4])
    >>> sadov = sp.rigid_body.geodesics.sadov_variables([3.0, 2.0, 1.0], state)
    >>> angles, actions = [sadov.own, sadov.precession, sadov.node], [sadov.action, sadov.total, sadov.vertical]
    >>> again = sp.rigid_body.geodesics.andoyer_from_sadov([3.0, 2.0, 1.0], angles, actions)
    >>> print(again.body_momentum.round(9))
    [1.5 0.3 0.4]
    """
    metric = _metric(moments)
    axes, metric = metric.andoyer_axes, _descending(metric)
    turn, action = finite_array(angles, "angles", (3,), unit="rad"), finite_array(actions, "actions", (3,))
    hemisphere = finite_array(side, "side")
    common_batch(angles=turn.shape[:-1], actions=action.shape[:-1], side=hemisphere.shape)
    if np.any(np.abs(hemisphere) != 1.0):
        raise ShapeError(f"side: 1 or -1 is needed, got {value_text(side)}")
    own, precession, node = np.moveaxis(turn, -1, 0)
    enclosed, total, vertical = np.moveaxis(action, -1, 0)
    if np.any((total <= 0.0) | (enclosed < 0.0) | (enclosed > total)):
        raise ShapeError("actions: J must be between 0 and G, which must be above 0")
    enclosed, hemisphere, _ = np.broadcast_arrays(enclosed, hemisphere, own)
    tilt = _tilt_of_action(metric, enclosed / total)
    across = _between_ends(tilt)
    family = metric.geodesics_of(across)
    if np.any(family.complement == 0.0):
        raise ShapeError("actions: J is that of the separatrix, where there are no angle variables")
    quarter = elliptic.complete_k(family.complement)
    u = 2.0 * quarter * own / np.pi
    sn, cn, dn, _, part = elliptic.jacobi_and_pi_excess(family.constants.characteristic, u, family.complement)
    whole = elliptic.complete_pi_excess(family.constants.characteristic, family.complement)
    i1, i2, i3 = ascending_moments(metric.moments)[0]
    # The inverse of `_argument`.
    oscillating, far = family.is_oscillating, np.sqrt(i3 - i1)
    small, large = np.sin(tilt), np.cos(tilt)
    middle = -hemisphere * small * far * sn / np.sqrt((i3 - i2) * i1 / i2)
    swinging = np.arctan2(hemisphere * large * dn, middle)
    turning = np.arctan2(cn / far, -hemisphere * sn / np.sqrt(i3 * (i2 - i1) / i2))
    state = AndoyerVariables(
        g=so3.wrap(precession - family.constants.third_kind * (part - whole * (u / quarter))),
        k=so3.wrap(node),
        l=np.where(oscillating, swinging, turning),
        total=total,
        vertical=vertical,
        axial=total * np.where(oscillating, small * cn, hemisphere * small * dn),
    )
    if np.array_equal(axes, np.eye(3)):
        return state
    return andoyer_variables(state.attitude @ axes.T, state.body_momentum @ axes.T)


def _metric(moments: ArrayLike) -> SerretAndoyerMetric:
    """`serret_andoyer_metric`, with an error for two equal moments that names the variables to use instead."""
    values = moments_argument(moments)
    if len(np.unique(values)) < 3:
        raise ShapeError(
            f"moments: got {values}, of which two are equal. Take `andoyer_variables` with the axis of symmetry as the "
            "third one: then l, g, k and L, G, K are angles and actions already, l' = L (1/I_s - 1/I_e) and "
            "g' = G/I_e, with I_s the moment about that axis and I_e the equal ones"
        )
    return serret_andoyer_metric(values)


def _descending(metric: SerretAndoyerMetric) -> SerretAndoyerMetric:
    """The metric in its own axes, `andoyer_axes`."""
    return serret_andoyer_metric(np.sort(metric.moments)[::-1])


def _between_ends(tilt: Array) -> Array:
    """Unit momenta between the axes of the largest and of the smallest moment, `andoyer_axes`: (...) -> (..., 3)."""
    return np.stack([np.cos(tilt), np.zeros(tilt.shape), np.sin(tilt)], axis=-1)


def _tilt_of_action(metric: SerretAndoyerMetric, share: Array) -> Array:
    """The angle from the axis of the largest moment at which the action is this share of G: (...) -> (...) [rad]."""
    low, high = np.zeros(share.shape), np.full(share.shape, 0.5 * np.pi)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        momentum = _between_ends(middle)
        speed = np.sqrt(np.sum(momentum**2 / metric.moments, axis=-1))
        below = speed * metric.geodesics_of(momentum).action < share
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.where(share == 0.0, 0.0, np.where(share == 1.0, 0.5 * np.pi, 0.5 * (low + high)))


def _argument(moments: Array, momentum: Array, angle: Array, oscillating: Mask, complement: Array) -> Array:
    """u of a state in [-K, 3 K), from l = +-pi/2 on; moments and momenta in `andoyer_axes`."""
    i1, i2, i3 = ascending_moments(moments)[0]
    largest, middle, smallest = np.moveaxis(momentum, -1, 0)
    near, rest, far = (i3 - i2) / i2, i3 * (i2 - i1) / i2, i3 - i1
    oscillation = -np.copysign(1.0, largest) * middle * np.sqrt(near * i1)
    # By l, which is defined along the axis of the smallest moment too, where no momentum is across it.
    rotation = -np.copysign(1.0, smallest) * np.cos(angle) * np.sqrt(rest)
    sine = np.where(oscillating, oscillation, rotation)
    cosine = np.where(oscillating, smallest, np.sin(angle)) * np.sqrt(far)
    short = elliptic.argument_of(sine, np.abs(cosine), complement)
    return np.where(cosine < 0.0, 2.0 * elliptic.complete_k(complement) - short, short)
