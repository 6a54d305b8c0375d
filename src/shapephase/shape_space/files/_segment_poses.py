"""Poses of segments, as suits, markerless systems and simulators record them, become base and joints of a body."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ... import so3
from ...arrays import Array, Integers
from ...body.body import Body
from ...body.couplings.ball_joints import RATES, coordinate_names
from ...display import short_repr
from ...errors import TrajectoryError, TrajectoryWarning
from ._segment_links import MOST_OFF_WAY, SHORT, Links, SegmentChoices, angle_of_ways
from .formats.segment_poses import pose_columns
from .recording import Recording, SegmentPoses, Table
from .times import recording_of

_LENGTH_TOLERANCE = 0.1
"""Share by which a distance between joints may differ from the body's: momentum is then off by a fifth."""
_MOST_OFF_HINGE = np.radians(15.0)
"""[rad] rms of what hinges leave of a turn; a knee bends by some degrees to the side."""
_ACROSS = 1e-6
"""Cosine of the angle between hinges at right angles."""


@dataclass(frozen=True, eq=False)
class SegmentMotion:
    """The angular momentum about the centre of mass of a body whose segments were recorded, in the recorder's axes.

    It is that of the turns and ways from each sample to the next, over the time between them.

    Attributes
    ----------
    times : (M,) halfway between samples, as the file tells them [s]
    of_poses : (M, 3) by the pose of every segment as it was recorded; None without positions [kg m^2/s]
    of_chain : (M, 3) by base and joints [kg m^2/s]
    record : links, calibration, lengths and what hinges leave over, as JSON can hold it

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

    __repr__ = short_repr

    def within(self, first: float, last: float) -> dict[str, Any]:
        """The record with means and rms difference of the momentum between two times [s], as JSON can hold it."""
        there = (self.times >= first) & (self.times <= last)
        found = dict(self.record)
        if there.any():
            found["momentum_of_chain"] = self.of_chain[there].mean(axis=0).tolist()
            if self.of_poses is not None:
                off = self.of_poses[there] - self.of_chain[there]
                found["momentum_of_poses"] = self.of_poses[there].mean(axis=0).tolist()
                found["momentum_difference_rms"] = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
        return found


def without_segments(
    table: Table, body: Body, choices: SegmentChoices, time_unit: str | None, timestep: float | None
) -> tuple[Table, dict[str, str | None]]:
    """The table with joints and base in the place of poses of segments, and the names that are left for its columns.

    Raises
    ------
    TrajectoryError
        If segments and links do not match, axes are not known, or lengths, ways between joints or turns of hinges are
        none that the body can have.
    """
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
        # The samples that are kept are warned about later.
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
            columns |= self._joints(frames[k].frame, frames[above].frame, turn)
        for name in columns:
            if name in table.columns:
                raise TrajectoryError(
                    f"{self.where}: joint {name} has a column, and segments that tell it; leave the column out with "
                    f"names={{{name!r}: None}} (--names {name}=)"
                )
        self.record["at_zero"] = [name for name in self.body.joint_names if name not in columns]
        shapes = np.tile(self.body.shape(), (len(turns), 1))
        for name, values in columns.items():
            shapes[:, self.body.joint_index(name)] = values
        whole = np.flatnonzero(np.isfinite(turns).all(axis=(1, 2, 3)))
        if len(whole) < 2:
            raise TrajectoryError(
                f"{self.where}: {len(whole)} samples have the poses of all segments, two are needed; leave out the "
                "segments that lack theirs, names={segment: None} (--names SEGMENT=)"
            )
        own = self.links.frame_poses(shapes[whole])
        places = None
        if self.poses.origins is not None:
            places = self.poses.origins[:, used] - so3.apply(turns, calibration.origins)
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

    def _joints(self, frame: int, above: int, turn: Array) -> dict[str, Array]:
        """Joint columns between two frames that segments show: turn (N, 3, 3), child axes to the parent's."""
        chain, rows = self.chain, []
        last = frame
        while frame != above:
            rows.insert(0, frame - 1)
            frame = chain.parents[frame - 1]
        before, hinges, balls = np.eye(3), {}, []
        in_balls = {ball.row + k: ball for ball in chain.follows.balls for k in range(len(RATES))}
        for row in rows:
            before = before @ chain.turns[row]
            if row in in_balls:
                balls += [(in_balls[row], before)] if in_balls[row].row == row else []
            elif chain.axes[row].any():
                drivers = np.flatnonzero(chain.matrix[row])
                name = chain.names[row]
                curved = any(joint.row == row for joint in chain.follows.curved)
                if curved or (len(drivers) and self.body.joint_names[drivers[0]] != name):
                    raise TrajectoryError(
                        f"{self.where}: joint {name} follows another, and poses of segments do not tell which has how "
                        "much. Give the coordinates themselves, of OpenSim the .mot file of the same motion"
                    )
                if len(drivers):
                    hinges[name] = before @ chain.axes[row]
                else:
                    before = before @ so3.exp(chain.offset[row] * chain.axes[row])
        if len(balls) == 1 and not hinges:
            joint, placed = balls[0]
            turned = placed.T @ turn @ before.T @ placed
            return dict(zip(coordinate_names(joint.name), _quaternions(turned).T, strict=True))
        if balls or len(hinges) > 3:
            raise TrajectoryError(
                f"{self.where}: above {chain.names[last - 1]} there are more joints than one ball joint or three "
                "hinges, and no segment between them; give a body with fewer, or a table of joint angles"
            )
        return self._hinges(hinges, turn @ before.T) if hinges else {}

    def _hinges(self, hinges: dict[str, Array], turns: Array) -> dict[str, Array]:
        """Angles of one to three hinges nearest to turns (N, 3, 3), and what they leave over."""
        axes, named = np.array(list(hinges.values())), ", ".join(hinges)
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
        if len(left):
            rms = float(np.sqrt(np.mean(left**2)))
            self.record.setdefault("hinges_leave_deg", {})[named] = float(np.degrees(rms))
            if rms > _MOST_OFF_HINGE:
                raise TrajectoryError(
                    f"{self.where}: {named} leave {np.degrees(rms):.0f} deg rms of the recorded turn, up to "
                    f"{np.degrees(_MOST_OFF_HINGE):.0f} deg are taken: the segment has other axes, or the body needs a "
                    "ball joint there. Give another calibration=T (--calibration T), or such a body"
                )
        angles[there] = np.unwrap(angles[there], axis=0)
        return dict(zip(hinges, angles.T.copy(), strict=False))

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
        """By the poses themselves and by the chain, of all mass; what no segment shows rests on what it hangs on."""
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
    found = np.full((len(turns), 4), np.nan)
    there = np.isfinite(turns).all(axis=(1, 2))
    found[there] = so3.quat_from_matrix(turns[there])
    return found
