"""Base and joints of a body from poses of segments, as suits, markerless systems and simulators record them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ... import so3
from ...arrays import Array, Integers
from ...body.body import Body
from ...body.couplings.ball_joints import RATES, coordinate_names
from ...display import frozen
from ...errors import TrajectoryError, TrajectoryWarning
from ._segment_links import MOST_OFF_WAY, SHORT, Links, SegmentChoices, angle_of_ways
from .formats.segment_poses import pose_columns
from .recording import Recording, SegmentPoses, Table
from .times import recording_of

_LENGTH_TOLERANCE = 0.1  # relative error of a distance between joints: the momentum is then off by a fifth
_MOST_OFF_HINGE = np.radians(15.0)  # [rad] rms that hinges leave of a turn; a knee bends sideways by some degrees
_MOST_DRIVERS = 3  # coordinates that one turn determines
_TRIED = (129, 25, 11)  # starting values of each of one, two or three coordinates, between its limits
_ROUNDS = 8  # Gauss-Newton steps: digits double from two on
_STEP = 1e-5  # [rad] of its central differences
_FEWEST_LINKS = 2  # links of a rigid part with another centre of mass than the recorded segment
_ACROSS = 1e-6  # cosine of the angle between orthogonal hinges


@frozen
class SegmentMotion:
    """Angular momentum about the centre of mass of a body whose segments were recorded, in the recorder's axes.

    It follows from the turns and ways from each sample to the next, over the time between them.

    Attributes
    ----------
    times : (M,) halfway between samples, as the file gives them [s]
    of_poses : (M, 3) by the pose of every segment as it was recorded; None without positions [kg m^2/s]
    of_chain : (M, 3) by base and joints [kg m^2/s]
    record : links, calibration, lengths and turns that hinges leave over, ready for JSON

    Examples
    --------
    >>> half = np.column_stack([np.zeros((3, 3)), np.ones(3)])
    >>> poses = np.column_stack([[0.0, 0.1, 0.2], half, half])
    >>> header = "time," + ",".join(f"{part}_q{axis}" for part in ("front", "rear") for axis in "xyzw")
    >>> np.savetxt("cat.csv", poses, delimiter=",", header=header, comments="")
    >>> recorded = sp.read_recorded_motion("cat.csv", sp.load_body("cat_two_halves"), calibration="links")
    >>> recorded.segments.of_chain.tolist()
    [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    """

    times: Array
    of_poses: Array | None
    of_chain: Array
    record: Mapping[str, Any]

    def within(self, first: float, last: float) -> dict[str, Any]:
        """The record with means and rms difference of the momentum between two times [s], ready for JSON."""
        there = (self.times >= first) & (self.times <= last)
        record = dict(self.record)
        if there.any():
            record["momentum_of_chain"] = self.of_chain[there].mean(axis=0).tolist()
            if self.of_poses is not None:
                off = self.of_poses[there] - self.of_chain[there]
                record["momentum_of_poses"] = self.of_poses[there].mean(axis=0).tolist()
                record["momentum_difference_rms"] = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
        return record


def without_segments(
    table: Table, body: Body, choices: SegmentChoices, time_unit: str | None, timestep: float | None
) -> tuple[Table, dict[str, str | None]]:
    """The table with joints and base in the place of poses of segments, and the names that are left for its columns."""
    names = dict(choices.names)
    if table.poses is None:
        table = pose_columns(table, names, body)
    if table.poses is None:
        if choices.given:
            raise TrajectoryError(
                f"{table.where}: calibration and length_tolerance are for poses of segments, columns SEGMENT_qx, "
                "SEGMENT_qy, SEGMENT_qz and SEGMENT_qw of two or more, and there are none; leave them out"
            )
        return table, names
    left = {text: name for text, name in names.items() if text not in table.poses.names}
    with warnings.catch_warnings():
        # Warnings about the samples that are kept follow later.
        warnings.simplefilter("ignore", TrajectoryWarning)
        mapping = {text: name for text, name in left.items() if text in table.columns}
        recording = recording_of(table, body.joint_names, mapping, time_unit, timestep, None)
    return _Conversion(recording, table.poses, body, choices).table(table), left


class _Conversion:
    def __init__(self, recording: Recording, poses: SegmentPoses, body: Body, choices: SegmentChoices) -> None:
        self.recording, self.poses, self.body, self.choices = recording, poses, body, choices
        self.where, self.chain = recording.table.where, body.chain
        self.links = Links(self.where, poses, body, choices.names)
        self.record: dict[str, Any] = {"links": {poses.names[f.segment]: f.link for f in self.links.frames}}
        if not poses.in_metres and self.links.in_millimetres:
            self.record["length_unit"] = "mm, by the body's lengths"
            assert poses.origins is not None
            self.poses = self.links.poses = replace(poses, origins=1e-3 * poses.origins)

    def table(self, table: Table) -> Table:
        """The table with columns of joints and the base."""
        frames, used = self.links.frames, [f.segment for f in self.links.frames]
        calibration = self.links.calibration(self.recording, self.choices, self.record)
        turns = self.poses.turns[:, used] @ calibration.turns
        columns: dict[str, Array] = {}
        for k, above in self.links.above.items():
            turn = so3.transpose(turns[:, above]) @ turns[:, k]
            rows = self._rows(frames[k].frame, frames[above].frame)
            joints = self._joints(rows, turn)
            # A shank determines a knee better than a patella, which only follows it.
            own = set(joints) <= {self.chain.names[row] for row in rows} or any(name.endswith(".w") for name in joints)
            columns = columns | joints if own else joints | columns
        whole = np.flatnonzero(np.isfinite(turns).all(axis=(1, 2, 3)))
        if len(whole) < 2:
            raise TrajectoryError(
                f"{self.where}: {len(whole)} samples have the poses of all segments, two are needed; leave out the "
                "segments that lack theirs, names={segment: None} (--names SEGMENT=)"
            )
        places = None
        if self.poses.origins is not None:
            places = self.poses.origins[:, used] - so3.apply(turns, calibration.origins)
            columns |= self._slides(self._shapes(columns, len(turns)), turns, places, whole)
        for name in columns:
            if name in table.columns:
                raise TrajectoryError(
                    f"{self.where}: joint {name} has a column, and segments that show it; leave the column out with "
                    f"names={{{name!r}: None}} (--names {name}=)"
                )
        self.record["at_zero"] = [name for name in self.body.joint_names if name not in columns]
        own = self.links.frame_poses(self._shapes(columns, len(turns))[whole])
        if places is not None:
            places[whole] = self._with_rigid_parts(places[whole], turns[whole], own)
            self._check_ways(places[whole], turns[whole], own)
        return replace(
            table,
            columns=table.columns | columns,
            units={
                **table.units,
                **{name: "rad" for name in columns if self.body.joint_units[self.body.joint_index(name)] == "rad"},
            },
            base_quat_xyzw=_quaternions(turns[:, 0]),
            base_position=None if places is None else places[:, 0],
            unread={**table.unread, **dict.fromkeys(self.links.left_out, "a segment that no joint needs")},
            segments=self._momentum(turns[whole], None if places is None else places[whole], own, whole),
            poses=None,
        )

    def _shapes(self, columns: Mapping[str, Array], count: int) -> Array:
        """Shapes (N, n) of joint columns, other joints at zero."""
        shapes = np.tile(self.body.shape(), (count, 1))
        for name, values in columns.items():
            shapes[:, self.body.joint_index(name)] = values
        return shapes

    def _slides(self, shapes: Array, turns: Array, places: Array, whole: Integers) -> dict[str, Array]:
        """Coordinates [m] of joints that slide one segment along another, by the places of both."""
        coordinates: dict[str, Array] = {}
        for k, above in self.links.above.items():
            ends = [self.links.frames[each].frame for each in (k, above)]
            rows = [row for row in self._rows(*ends) if not self.chain.axes[row].any()]
            names = [self.chain.names[row] for row in rows if self.chain.names[row] in self.body.joint_names]
            if not names:
                continue
            columns = [self.body.joint_index(name) for name in names]

            def apart(values: Array, columns: list[int] = columns, ends: list[int] = ends) -> Array:
                moved = shapes[whole]
                moved[:, columns] = values
                poses = self.links.frame_poses(moved)
                return so3.apply(so3.transpose(poses[ends[1]][0]), poses[ends[0]][1] - poses[ends[1]][1])

            start = apart(np.zeros(len(names)))
            ways = np.stack([apart(unit) - start for unit in np.eye(len(names))], axis=-1)
            recorded = so3.apply(so3.transpose(turns[:, above]), places[:, k] - places[:, above])[whole]
            values = np.full((len(names), len(turns)), np.nan)
            values[:, whole] = so3.apply(np.asarray(np.linalg.pinv(ways), dtype=np.float64), recorded - start).T
            coordinates |= dict(zip(names, values, strict=True))
        return coordinates

    def _rows(self, frame: int, above: int) -> list[int]:
        """The joints between two frames, those near the upper one first."""
        rows = []
        while frame != above:
            rows.insert(0, frame - 1)
            frame = self.chain.parents[frame - 1]
        return rows

    def _joints(self, rows: list[int], turn: Array) -> dict[str, Array]:
        """Joint columns of some joints in a row: turn (N, 3, 3), axes of the last frame to those of the first."""
        chain = self.chain
        before, balls = np.eye(3), []
        hinges: dict[str, tuple[Array, float, float]] = {}  # axis at zero; angle = factor * coordinate + offset
        in_balls = {ball.row + k: ball for ball in chain.follows.balls for k in range(len(RATES))}
        curved = {joint.row: joint for joint in chain.follows.curved}
        together: set[str] = set()
        for row in rows:
            before = before @ chain.turns[row]
            if row in in_balls:
                balls += [(in_balls[row], before)] if in_balls[row].row == row else []
            elif row in curved and chain.axes[row].any():
                together |= {chain.names[source] for source, _ in curved[row].terms}
            elif chain.axes[row].any():
                drivers = [self.body.joint_names[k] for k in np.flatnonzero(chain.matrix[row])]
                if not drivers:
                    before = before @ so3.exp(chain.offset[row] * chain.axes[row])
                elif len(drivers) > 1 or drivers[0] in hinges:
                    together |= {*drivers}
                else:
                    factor = float(chain.matrix[row, self.body.joint_index(drivers[0])])
                    hinges[drivers[0]] = before @ chain.axes[row], factor, float(chain.offset[row])
        if together:
            return self._followed({*together, *hinges}, rows, turn)
        if len(balls) == 1 and not hinges:
            joint, placed = balls[0]
            turned = placed.T @ turn @ before.T @ placed
            return dict(zip(coordinate_names(joint.name), _quaternions(turned).T, strict=True))
        if balls or len(hinges) > 3:
            raise TrajectoryError(
                f"{self.where}: above {chain.names[rows[-1]]} there are more joints than one ball joint or three "
                "hinges, and no segment between them; give a body with fewer, or a table of joint angles"
            )
        return self._hinges(hinges, turn @ before.T) if hinges else {}

    def _hinges(self, hinges: dict[str, tuple[Array, float, float]], turns: Array) -> dict[str, Array]:
        """Coordinates of one to three hinges nearest to turns (N, 3, 3), and what they leave over."""
        axes, named = np.array([axis for axis, _, _ in hinges.values()]), ", ".join(hinges)
        if np.abs(np.sum(axes[1:] * axes[:-1], axis=1)).max(initial=0.0) > _ACROSS:
            raise TrajectoryError(
                f"{self.where}: hinges {named} are not at right angles; give a table of joint angles, or a body with a "
                "ball joint there"
            )
        there = np.isfinite(turns).all(axis=(1, 2))
        angles, left = np.full((len(turns), 3), np.nan), np.zeros(0)
        if len(axes) == 1:
            angles[there, 0] = so3.angle_about(turns[there], axes[0])
            left = so3.angle(so3.exp(-angles[there, :1] * axes[0]) @ turns[there])
        elif there.any():
            order = axes if len(axes) == 3 else np.vstack([axes, np.cross(axes[0], axes[1])])
            angles[there] = Rotation.from_matrix(turns[there]).as_davenport(order, "intrinsic")
            left = angles[there, 2] if len(axes) == 2 else left
        self._check_left(named, left)
        angles[there] = np.unwrap(angles[there], axis=0)
        return {name: (angles[:, k] - offset) / factor for k, (name, (_, factor, offset)) in enumerate(hinges.items())}

    def _followed(self, drivers: set[str], rows: list[int], turns: Array) -> dict[str, Array]:
        """Up to three coordinates that turn a segment together, as of a knee, nearest to turns (N, 3, 3)."""
        own = [name for name in self.body.joint_names if name in drivers]
        if not own:
            return {}
        if len(own) > _MOST_DRIVERS:
            raise TrajectoryError(
                f"{self.where}: joints {', '.join(sorted(drivers))} turn one segment together, and its pose does not "
                "say which has how much. Give the coordinates themselves, of OpenSim the .mot file of the same motion"
            )
        frame, above = rows[-1] + 1, self.chain.parents[rows[0]]
        columns, there = [self.body.joint_index(name) for name in own], np.isfinite(turns).all(axis=(1, 2))

        def turned(values: Array) -> Array:
            shapes = np.tile(self.body.shape(), (len(values), 1))
            shapes[:, columns] = values
            poses = self.links.frame_poses(shapes)
            return so3.transpose(poses[above][0]) @ poses[frame][0]

        ends = np.clip(self.body.joint_limits[columns], -np.pi, np.pi)
        lines = [np.linspace(first, last, _TRIED[len(own) - 1]) for first, last in ends]
        tried = np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, len(own))
        values = tried[np.argmax(np.einsum("kij,nij->nk", turned(tried), turns[there]), axis=1)]
        for _ in range(_ROUNDS):
            off = so3.log(so3.transpose(turned(values)) @ turns[there])
            steps = _STEP * np.eye(len(own))
            sides = [so3.log(so3.transpose(turned(values - step)) @ turned(values + step)) for step in steps]
            rates = np.stack(sides, axis=-1) / (2.0 * _STEP)
            values = values + so3.apply(np.asarray(np.linalg.pinv(rates), dtype=np.float64), off)
        self._check_left(", ".join(own), so3.angle(so3.transpose(turned(values)) @ turns[there]))
        coordinates = np.full((len(own), len(turns)), np.nan)
        coordinates[:, there] = values.T
        return dict(zip(own, coordinates, strict=True))

    def _check_left(self, named: str, left: Array) -> None:
        """Keep what hinges leave of turns [rad]. Raises TrajectoryError where it is large."""
        if not len(left):
            return
        rms = float(np.sqrt(np.mean(left**2)))
        self.record.setdefault("hinges_leave_deg", {})[named] = float(np.degrees(rms))
        if rms > _MOST_OFF_HINGE:
            raise TrajectoryError(
                f"{self.where}: {named} leave {np.degrees(rms):.0f} deg rms of the recorded turn, up to "
                f"{np.degrees(_MOST_OFF_HINGE):.0f} deg are taken: the segment has other axes, or the body needs a "
                "ball joint there. Give another calibration=T (--calibration T), or such a body"
            )

    def _with_rigid_parts(self, places: Array, turns: Array, own: dict[int, tuple[Array, Array]]) -> Array:
        """Places (M, k, 3) of frames, those whose segment is one of several links in one by where the chain has them.

        The chain keeps the centre of mass of such links together; recorded is that of one, a constant from the frame.
        """
        links = [frame for frame, _ in self.chain.link_frames.values()]
        if not self.poses.at_centres:
            return places
        places = places.copy()
        for k, above in self.links.above.items():
            frame, upper = (self.links.frames[each].frame for each in (k, above))
            if links.count(frame) < _FEWEST_LINKS:
                continue
            way = so3.apply(so3.transpose(own[upper][0]), own[frame][1] - own[upper][1])
            off = places[:, k] - places[:, above] - so3.apply(turns[:, above], way)
            constant = np.mean(so3.apply(so3.transpose(turns[:, k]), off), axis=0)
            places[:, k] -= so3.apply(turns[:, k], constant)
        return places

    def _check_ways(self, places: Array, turns: Array, own: dict[int, tuple[Array, Array]]) -> None:
        """Raise TrajectoryError where joints are farther apart than the body's, or lie elsewhere."""
        lengths = self.record["lengths"] = []
        most = self.choices.length_tolerance or _LENGTH_TOLERANCE
        for k, above in self.links.above.items():
            ends = [self.links.frames[each] for each in (above, k)]
            (turn, first), (_, second) = (own[f.frame] for f in ends)
            ways = so3.apply(so3.transpose(turn), second - first)
            recorded = so3.apply(so3.transpose(turns[:, above]), places[:, k] - places[:, above])
            sizes, usual = np.linalg.norm(recorded, axis=-1), float(np.mean(np.linalg.norm(ways, axis=-1)))
            mean, spread = float(np.mean(sizes)), float(np.std(sizes))
            upper, lower = (f.link for f in ends)
            lengths.append({"from": upper, "to": lower, "body_m": usual, "mean_m": mean, "spread_m": spread})
            if abs(mean - usual) > max(most * usual, SHORT):
                raise TrajectoryError(
                    f"{self.where}: from {upper} to {lower} there are {mean:.4g} m on average (spread {spread:.2g} m), "
                    f"and {usual:.4g} m in {self.body.name}; up to {most:.0%} or {SHORT:g} m are taken. Is the unit "
                    f"right (as in `{lower}_x [mm]`)? Give a body of these lengths, as an MVNX file is one, or allow "
                    "more: length_tolerance=0.2 (--length-tolerance 0.2)"
                )
            apart = angle_of_ways(np.mean(recorded, axis=0), np.mean(ways, axis=0))
            if apart > MOST_OFF_WAY:
                raise TrajectoryError(
                    f"{self.where}: {lower} lies {np.degrees(apart):.0f} deg off its place on {upper} in "
                    f"{self.body.name}: the segments' axes are not those of the links. Give calibration=T "
                    "(--calibration T), a time at which the body stands in its zero pose"
                )

    def _momentum(
        self, turns: Array, places: Array | None, own: dict[int, tuple[Array, Array]], rows: Integers
    ) -> SegmentMotion:
        """Momentum by the poses and by the chain; a part without a segment is fixed to the one it hangs on."""
        table = self.recording.table
        assert table.times is not None
        times, masses = table.times[rows], self.chain.masses
        heavy = [frame for frame in own if masses[frame] > 0.0]
        order = {f.frame: k for k, f in enumerate(self.links.frames)}
        chain = [(turns[:, 0] @ own[frame][0], so3.apply(turns[:, 0], own[frame][1])) for frame in heavy]
        of_poses = None
        if places is not None:
            recorded = []
            for frame in heavy:
                at = frame if frame in order else self.links.shown_by(frame)
                back, k = so3.transpose(own[at][0]), order[at]
                apart = so3.apply(back, own[frame][1] - own[at][1])
                recorded.append((turns[:, k] @ back @ own[frame][0], places[:, k] + so3.apply(turns[:, k], apart)))
            of_poses = self._between(times, heavy, recorded)
        return SegmentMotion(0.5 * (times[1:] + times[:-1]), of_poses, self._between(times, heavy, chain), self.record)

    def _between(self, times: Array, heavy: list[int], poses: list[tuple[Array, Array]]) -> Array:
        """Angular momentum between samples, sum of R I R^T omega + m (x - c) x (v - w), c of the whole: (M, 3)."""
        steps, masses = np.diff(times)[:, None], self.chain.masses[heavy]
        centres = np.stack(
            [place + turn @ self.chain.centres[f] for f, (turn, place) in zip(heavy, poses, strict=True)]
        )
        centres = centres - np.tensordot(masses / masses.sum(), centres, axes=1)
        middles, speeds = 0.5 * (centres[:, 1:] + centres[:, :-1]), np.diff(centres, axis=1) / steps
        total = np.tensordot(masses, np.cross(middles, speeds), axes=1)
        for frame, (turn, _) in zip(heavy, poses, strict=True):
            step = so3.log(so3.transpose(turn[:-1]) @ turn[1:])
            halfway = turn[:-1] @ so3.exp(0.5 * step)
            total += so3.apply(halfway, (step / steps) @ self.chain.inertias[frame])
        return total


def _quaternions(turns: Array) -> Array:
    """(N, 3, 3) -> (N, 4), NaN where there is no turn."""
    quaternions = np.full((len(turns), 4), np.nan)
    there = np.isfinite(turns).all(axis=(1, 2))
    quaternions[there] = so3.quat_from_matrix(turns[there])
    return quaternions
