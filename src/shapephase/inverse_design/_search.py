"""Members of a family of deformations, the searches among them, and the enclosure of all."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from .. import so3
from ..arguments import check_object
from ..arrays import Array
from ..bounds.energy import energy_along, homoclinic_energy
from ..bounds.regimes import Regime, RegimeCertificate, regime_certificate
from ..deformation.deformation import Deformation
from ..phases.phase_split import PhaseSplit
from ..phases.phases import split
from ..reconstruction.reconstruction import Motion, reconstruct
from ._family_cover import Cover, FamilySamples, NotEnclosed, panel_of

_NEWTON_STEPS = 20
_DAMPINGS = 0.5 ** np.arange(7)
_DIFFERENCE = 1e-5  # of the box, for central differences: the motions' errors change slopes by 1e-7, curvature by less
_STARTS = 8  # members for each parameter among which a search begins
_NEWTON_STARTS = 5  # the best of them, from which steps are taken
_COVER_STARTS = 20  # centres of boxes that may hold a solution, from which steps are taken
_MARGIN_TRIALS = 80  # members by which a margin is made greater
_SHARE = 0.9  # of a centre's miss that differences within the box may take up, for the box to be excluded
_MOST_OF_MARGIN = 0.7  # earlier times than that of the least margin are enclosed by larger boxes
_SMALLEST_BOX = 1e-6  # of the family's: smaller ones fail by the error of the series
_FINE = 1e-3  # resolution of a certificate that fails at the usual one


@dataclass(frozen=True, eq=False)
class Goals:
    """Wanted values; None where any will do. Phases in the gauge, angles in rad."""

    theta: float | None
    dynamic: float | None
    attitude: Array | None
    regime: str | None
    gauge: str

    @property
    def names(self) -> list[str]:
        """Names of those that are given."""
        return [name for name in ("theta", "dynamic", "attitude", "regime") if getattr(self, name) is not None]


@dataclass(frozen=True, eq=False)
class Member:
    """Motion of a member and its distances from the goals.

    x : parameters
    misses : goal -> its distance, a vector [rad]
    error : estimate of the largest error of those angles [rad]
    margin : least distance of E_t from the homoclinic energy on the side of the wanted regime [J]
    shortfalls : times and negative margins from which a regime is excluded [s], [J]
    """

    x: Array
    motion: Motion
    phases: PhaseSplit
    misses: dict[str, Array]
    error: float
    margin: float
    shortfalls: tuple[tuple[float, float], ...]

    @property
    def residual(self) -> Array:
        """All distances together [rad]."""
        return np.concatenate([np.zeros(0), *self.misses.values()])

    @property
    def miss(self) -> float:
        """Largest distance from a goal that is an angle [rad]."""
        return max((float(np.linalg.norm(part)) for part in self.misses.values()), default=0.0)


class OutOfMembers(Exception):
    """All members that were allowed are computed."""


class Search:
    """Searches of a box of parameters (n, 2) for a member that meets all goals."""

    def __init__(
        self,
        family: Callable[[Array], Deformation],
        state: tuple[Array, Array],
        box: Array,
        goals: Goals,
        tolerance: float,
        most: int,
    ) -> None:
        """Begin with no member; `state` is the momentum (3,) and the initial attitude (3, 3)."""
        self._family, self._state, self._box, self._goals = family, state, box, goals
        self._tolerance, self._most = tolerance, most
        self._magnitude = float(np.linalg.norm(state[0]))
        self._deformations: dict[bytes, Deformation] = {}
        self._margins: dict[bytes, float] = {}
        self.members: dict[bytes, Member] = {}

    @property
    def nearest(self) -> Member:
        """Member that misses the goals least; without angles the one with the greatest margin."""
        return min(self.members.values(), key=lambda member: (member.miss, -member.margin))

    def certificate(self, member: Member) -> RegimeCertificate | None:
        """Certificate of the wanted regime, or of what is certain in its place; None without that goal."""
        if self._goals.regime is None:
            return None
        deformation = member.motion.deformation
        found = regime_certificate(deformation, *self._state)
        if found.regime == self._goals.regime or member.margin <= 0.0:
            return found
        return regime_certificate(deformation, *self._state, resolution=_FINE)

    def meets(self, member: Member) -> bool:
        """Whether a member meets all goals, the regime by a certificate."""
        if member.miss > self._tolerance or member.margin <= 0.0:
            return False
        certificate = self.certificate(member)
        return certificate is None or certificate.regime == self._goals.regime

    def searched(self, first: Array) -> Member | None:
        """Member that meets the goals, searched for from `first` and others. Raises OutOfMembers."""
        low, high = self._box.T
        starts = [self._member(first), *(self._member(low + share * (high - low)) for share in _shares(len(low)))]
        if self._goals.names == ["regime"]:
            best = self._widest(max(starts, key=self._certain_margin))
            return best if self.meets(best) else None
        others = sorted(starts[1:], key=lambda member: float(np.linalg.norm(member.residual)))
        ends = (self._newton(member) for member in [starts[0], *others[:_NEWTON_STARTS]])
        return next((end for end in ends if end is not None and self.meets(end)), None)

    def covered(self) -> tuple[Member | None, Cover | None]:
        """Member that meets the goals, or a cover by boxes without one. Raises OutOfMembers, NotEnclosed."""
        if self.nearest.motion.deformation.has_wheels:
            raise NotEnclosed("families with wheels are not enclosed; give another start")
        samples = FamilySamples(self._deformation, self._box)
        smallest = _SMALLEST_BOX * np.diff(self._box, axis=1)
        boxes, excluded, tried = deque([(self._box, 1.0)]), [], 0
        while boxes:
            box, growth = boxes.popleft()
            if np.all(np.diff(box, axis=1) < smallest):
                raise NotEnclosed("the family comes very near to it; give another start, or a looser tolerance")
            x = box.mean(axis=1)
            # What the motion of the nearest box larger than this one says is enough to see that this one is too large.
            known = samples.differences(box, self._deformation(x), growth, self._magnitude)
            if known is not None or self._goals.regime is not None:
                centre = self._member(x)
                growth = float(centre.motion.amplification)
                why = self._excluding(box, centre, samples)
                if why is not None:
                    excluded.append((box, *why))
                    continue
                if tried < _COVER_STARTS and centre.misses:
                    tried += 1
                    end = self._newton(centre)
                    if end is not None and self.meets(end):
                        return end, None
            boxes.extend((half, growth) for half in _halves(box, self._box))
        covering, names, centres, least = zip(*excluded, strict=True)
        return None, Cover(np.array(covering), np.array(centres), np.array(least), tuple(names))

    def _excluding(self, box: Array, centre: Member, samples: FamilySamples) -> tuple[str, float, float] | None:
        """Goal that no member of a box meets, how far its centre misses it, and how far all; None for none."""
        deformation, growth = centre.motion.deformation, float(centre.motion.amplification)
        known = samples.differences(box, deformation, growth, self._magnitude) if centre.misses else None
        if known is not None:
            reach = {"dynamic": known.dynamic, "attitude": known.attitude, "theta": np.inf}
            turned = known.attitude + (known.lift if self._goals.gauge == "horizontal" else 0.0)
            gap = float(centre.phases.momentum_gap) + turned
            if gap < np.pi:
                # How fast the twist about the momentum changes with a rotation that tilts it by `gap`.
                reach["theta"] = turned / np.cos(0.5 * gap)
            for name, miss in centre.misses.items():
                distance, room = float(np.linalg.norm(miss)), reach[name] + centre.error
                if room < _SHARE * distance:
                    return name, distance, distance - room
        for time, margin in centre.shortfalls:
            panel = panel_of(deformation, time)
            known = samples.differences(box, deformation, growth, self._magnitude, panel)
            if known is not None:
                turned = known.attitude + float(centre.motion.error_estimate)
                change = 2.0 * known.inverse[panel] + known.spread[panel] * turned
                room = 0.5 * self._magnitude**2 * change
                if room < -_SHARE * margin:
                    return "regime", -margin, -margin - room
        return None

    def _newton(self, start: Member) -> Member | None:
        """Member that meets the angles, by damped Gauss-Newton steps from another; None where they stall."""
        here, (low, high) = start, self._box.T
        for _ in range(_NEWTON_STEPS):
            if here.miss <= self._tolerance:
                return here
            slopes = np.empty((len(here.residual), len(low)))
            for k, step in enumerate(_DIFFERENCE * np.diag(high - low)):
                ahead, behind = (self._member(np.clip(here.x + sign * step, low, high)) for sign in (1.0, -1.0))
                slopes[:, k] = so3.wrap(ahead.residual - behind.residual) / (ahead.x - behind.x)[k] * (high - low)[k]
            move = np.linalg.lstsq(slopes, -here.residual, rcond=1e-9)[0] * (high - low)
            trials = (self._member(np.clip(here.x + damping * move, low, high)) for damping in _DAMPINGS)
            before = float(np.linalg.norm(here.residual))
            better = next((trial for trial in trials if np.linalg.norm(trial.residual) < before), None)
            if better is None:
                return None
            here = better
        return here if here.miss <= self._tolerance else None

    def _widest(self, start: Member) -> Member:
        """Member near another whose regime is certain by a greater margin.

        The margins of motions alone tell too little: many members have that of the start.
        """
        low, high = self._box.T

        def narrowness(share: Array) -> float:
            return -self._certain_margin(self._member(np.clip(low + share * (high - low), low, high)))

        minimize(
            narrowness,
            (start.x - low) / (high - low),
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * len(low),
            options={"maxfev": _MARGIN_TRIALS, "xatol": 1e-6, "fatol": 1e-12 * (1.0 + abs(start.margin))},
        )
        return max(self.members.values(), key=self._certain_margin)

    def _certain_margin(self, member: Member) -> float:
        """Margin by which a certificate has the wanted regime [J]; negative where it has not."""
        key = member.x.tobytes()
        if key not in self._margins:
            found = regime_certificate(member.motion.deformation, *self._state)
            other = found.certain and found.regime != self._goals.regime
            self._margins[key] = -found.margin if other else found.margin
        return self._margins[key]

    def _deformation(self, x: Array) -> Deformation:
        """The member at x. Raises WrongObjectError for another object."""
        key = x.tobytes()
        if key not in self._deformations:
            self._deformations[key] = self._family(x.copy())
            check_object(self._deformations[key], "Deformation", "family(x)")
        return self._deformations[key]

    def _member(self, x: Array) -> Member:
        """Motion of the member at x and its distances from the goals. Raises OutOfMembers."""
        key = x.tobytes()
        if key in self.members:
            return self.members[key]
        if len(self.members) >= self._most:
            raise OutOfMembers(f"all members={self._most} were computed; allow more, or give another start")
        deformation, goals = self._deformation(x), self._goals
        motion = reconstruct(deformation, *self._state, tolerance=max(0.01 * self._tolerance, 1e-12))
        phases = split(motion, goals.gauge)
        misses, errors = {}, [0.0]
        if goals.theta is not None:
            misses["theta"] = np.array([so3.wrap(float(phases.montgomery_phase) - goals.theta)])
            errors.append(float(phases.error_estimates.montgomery_angle))
        if goals.dynamic is not None:
            misses["dynamic"] = np.array([float(phases.dynamic_phase) - goals.dynamic])
            errors.append(float(phases.error_estimates.dynamic_phase))
        if goals.attitude is not None:
            misses["attitude"] = so3.log(motion.final_attitude @ goals.attitude.T)
            errors.append(float(motion.error_estimate))
        margin, shortfalls = np.inf, ()
        if goals.regime is not None:
            times = motion.solution.times
            above = energy_along(motion, times) - homoclinic_energy(deformation, times, self._magnitude)
            margins = above if goals.regime == Regime.ABOUT_SMALLEST else -above
            margin = float(margins.min())
            first = int(np.argmax(margins <= max(margin, _MOST_OF_MARGIN * margin)))
            shortfalls = tuple((float(times[k]), float(margins[k])) for k in (0, first) if margins[k] < 0.0)
        self.members[key] = Member(x, motion, phases, misses, max(errors), margin, shortfalls)
        return self.members[key]


def _shares(count: int) -> Array:
    """Points spread over the unit cube of so many dimensions: (_STARTS count, count).

    Source: Roberts 2018, the sequence R_d, whose steps are powers of the root of x^(d + 1) = x + 1.
    """
    root = np.roots([1.0, *np.zeros(count - 1), -1.0, -1.0]).real.max()
    return np.mod(0.5 + np.arange(1, _STARTS * count + 1)[:, None] * root ** -np.arange(1.0, count + 1.0), 1.0)


def _halves(box: Array, whole: Array) -> Iterator[Array]:
    """Halves of a box across its longest side, measured by those of the family's."""
    axis = int(np.argmax(np.diff(box, axis=1) / np.diff(whole, axis=1)))
    for side in (0, 1):
        half = box.copy()
        half[axis, 1 - side] = box[axis].mean()
        yield half
