"""Every error and warning of the library: what came, what was expected, the valid choices, and where.

`ShapePhaseError` is the root. A bad value is also a `ValueError`, a missing file also a `FileNotFoundError`,
a failed computation also an `ArithmeticError`, so that a caller who knows only Python's own names catches them too.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pickle import PicklingError

from .letters import value_text

_LONGEST_NAME = 1000  # characters up to which an error repeats a name: no name that is meant has more
_LONGEST_SHOWN = 80  # of a longer one


class ShapePhaseError(Exception):
    """Root of every error raised on purpose by this library.

    Examples
    --------
    >>> try:
    ...     sp.load_body("catt")
    ... except sp.ShapePhaseError as error:  # of any kind
    ...     print(type(error).__name__)
    UnknownNameError
    """


class ShapeError(ShapePhaseError, ValueError):
    """An array has the wrong shape or type, or an entry is not a finite number.

    Remedy: the message names the argument, what came and what was expected; arrays of text, objects, complex numbers
    or with masked entries are refused, never converted.

    Examples
    --------
    >>> try:
    ...     sp.reconstruct(sp.rigid(np.eye(3), 1.0), [1.0, 2.0])
    ... except sp.errors.ShapeError as error:
    ...     print(str(error)[:72])
    momentum: expected shape (..., 3) [kg m^2/s], got (2,)
    """


class WrongObjectError(ShapeError, TypeError):
    """A function got another kind of object than it needs, or an argument that it does not have.

    Remedy: the message says what is needed, what came, and how the one is made of the other; or which arguments there
    are.

    Examples
    --------
    >>> try:
    ...     sp.split(3.0)
    ... except sp.errors.WrongObjectError as error:
    ...     print(str(error)[:72])
    motion: a Motion is needed, got a float; make it with reconstruct(deform
    """


class UnknownNameError(ShapePhaseError, ValueError):
    """A joint, body, motion, gauge or method that does not exist.

    Remedy: the message lists the names there are, and the nearest.

    Examples
    --------
    >>> try:
    ...     sp.load_body("catt")
    ... except sp.errors.UnknownNameError as error:
    ...     print(str(error)[:72])
    unknown body (no such file either) 'catt'. Did you mean 'cat'? Valid: as
    """


class ModelFileError(ShapePhaseError, ValueError):
    """A body's file or model cannot be used as it is.

    Causes: missing or broken XML, text where a number belongs, links without a parent or with two, joints with several
    axes, unexpanded macros, or a parsed model that differs from the file. Remedy: the message begins with file, line
    and element, and says how to correct it.

    Examples
    --------
    >>> with open("empty.urdf", "w") as file:
    ...     _ = file.write("<robot/>")
    >>> try:
    ...     sp.load_body("empty.urdf")
    ... except sp.errors.ModelFileError as error:
    ...     print(str(error)[:72])
    empty.urdf:1: robot 'robot': has no links; a body needs at least one <li
    """


class NoCollisionGeometryError(ModelFileError):
    """A body has no shapes to compute the distances of its links with.

    Remedy: load it from a URDF or MJCF file with <collision> or <visual> elements.
    """


class UnphysicalInertiaError(ModelFileError):
    """A link has a mass or an inertia that no body can have.

    Remedy: correct the file; if only principal moments are negative, `load_body(..., on_unphysical="warn")` takes it.

    Examples
    --------
    >>> try:
    ...     sp.deformation.rigid_part(1.0, np.diag([1.0, 1.0, 4.0]))
    ... except sp.errors.UnphysicalInertiaError as error:
    ...     print(str(error)[:72])
    the principal moments [1. 1. 4.] kg m^2 break the triangle inequality by
    """


class InputFileNotFoundError(ShapePhaseError, FileNotFoundError):
    """A file named by the user is not there or cannot be opened. Remedy: look at the path and its permissions.

    Examples
    --------
    >>> try:
    ...     sp.load_body("nowhere.urdf")
    ... except sp.errors.InputFileNotFoundError as error:
    ...     print(str(error)[:35])
    nowhere.urdf: there is no such file
    """


class OutputFileError(ShapePhaseError, OSError):
    """A file that cannot be written.

    Causes: a folder of that name, no permission, a full disk, a name that is too long. Remedy: the message names the
    file and the cause; another place. The old file, where there was one, is as it was.

    Examples
    --------
    >>> import os
    >>> os.mkdir("folder.npz")
    >>> try:
    ...     sp.reconstruct(sp.rigid(np.eye(3), 1.0), [0.0, 0.0, 1.0]).save("folder.npz")
    ... except sp.errors.OutputFileError as error:
    ...     print(str(error)[:72])
    cannot write folder.npz: it is a folder; name a file in it
    """


class TrajectoryError(ShapePhaseError, ValueError):
    """A trajectory that cannot be used as a function of time: its times, joints, values or ends.

    Remedy: the message names file, row and joint; times must ascend, every joint of the body must be there or rest
    somewhere, angles are in radians unless the file or the caller says degrees. A unit that can only be guessed is an
    error that names the argument to give.

    Examples
    --------
    >>> try:
    ...     sp.ShapePath.waypoints([0.0, 0.0], [[0.0], [1.0]])
    ... except sp.errors.TrajectoryError as error:
    ...     print(str(error)[:72])
    times must ascend: sample 1 at 0 s follows 0 s
    """


class UnknownColumnError(UnknownNameError, TrajectoryError):
    """A column of a motion file that matches no joint of the body.

    Remedy: the message names the column, the joints and the nearest; `names={column: joint}` maps a column to a joint,
    or to None to leave it out.

    Examples
    --------
    >>> np.savetxt("bad.csv", [[0.0, 0.0], [1.0, 0.1]], delimiter=",", header="time,tail", comments="")
    >>> try:
    ...     sp.read_shape_path("bad.csv", sp.load_body("cat_two_halves"))
    ... except sp.errors.UnknownColumnError as error:
    ...     print(str(error)[:40])
    unknown column in bad.csv; joint of cat_
    """


class OpenPathError(TrajectoryError):
    """A closed loop of shapes is needed, but the path does not end where it begins.

    Remedy: close the path (the message names the joint and its gap), or use what open paths have: `horizontal_lift`,
    `split`, `arc_phases`.

    Examples
    --------
    >>> try:
    ...     sp.holonomy(sp.load_body("satellite"), sp.examples.antenna_deployment())
    ... except sp.errors.OpenPathError as error:
    ...     print(str(error)[:72])
    the holonomy of an open path is undefined: joint boom_extension ends 1.8
    """


class NoisyPathError(TrajectoryError):
    """A function of time whose values scatter however near its times are: it has no rate.

    Remedy: smooth the data, with `read_shape_path(..., smooth=)` or a spline through fewer samples. A function that is
    merely rough is an `AccuracyNotReached`.
    """


class SingularInertiaError(ShapePhaseError, ArithmeticError):
    """The locked inertia is not positive definite: some axis has no inertia, so the rotation is undefined.

    Cause: masses all on one line, or links without mass. Remedy: the message names the time; give mass to the links.

    Examples
    --------
    >>> try:
    ...     sp.reconstruct(sp.rigid(np.zeros((3, 3)), 1.0), [1.0, 0.0, 0.0])
    ... except sp.errors.SingularInertiaError as error:
    ...     print(str(error)[:72])
    locked inertia is not positive definite: principal moments [0. 0. 0.] kg
    """


class AccuracyNotReached(ShapePhaseError, ArithmeticError):
    """The requested tolerance was not met; the best estimate is in the message.

    Causes: a motion that is rough between its breaks, errors that grow along a long unstable motion, a tolerance near
    rounding. Remedy: declare the times of kinks as breaks, loosen the tolerance, or shorten the motion.
    """


class GaugeError(ShapePhaseError, ArithmeticError):
    """The requested frame is not continuous along the motion, or does not exist for this kind of deformation.

    Remedy: the message names the time; the horizontal and the base gauge always exist.

    Examples
    --------
    >>> try:
    ...     sp.link_gauge(sp.rigid(np.eye(3), 1.0), "head")
    ... except sp.errors.GaugeError as error:
    ...     print(str(error)[:72])
    there is no link 'head': only the deformation of an articulated body has
    """


class ChartPoleError(ShapePhaseError, ArithmeticError):
    """Euler angles whose middle angle is at or next to 0 or pi, where they are not coordinates of rotations.

    Remedy: turn the inertial or the body axes by a constant rotation, or work with attitudes and body momenta.

    Examples
    --------
    >>> try:
    ...     sp.rigid_body.ZXZ.rates([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    ... except sp.errors.ChartPoleError as error:
    ...     print(str(error)[:55])
    theta: entry [] is 0; a pole of the ZXZ chart to 1e-08,
    """


class LieAlgebraError(ShapePhaseError, ValueError):
    """Structure constants that define no Lie algebra, or an element outside the algebra or group it is used in.

    Remedy: the message names the law that fails and by how much; structure constants are c[i, j, k] with
    [e_i, e_j] = c[i, j, k] e_k.

    Examples
    --------
    >>> try:
    ...     sp.rigid_body.lie.LieAlgebra(np.ones((2, 2, 2)))
    ... except sp.errors.LieAlgebraError as error:
    ...     print(str(error)[:72])
    structure: not antisymmetric, c[0, 0, 0] = 1 and c[0, 0, 0] = 1; [e_i, e
    """


class MissingExtraError(ShapePhaseError, ImportError):
    """An optional dependency is not installed. Remedy: the message names the extra to install."""


class RunStopped(ShapePhaseError):
    """The `progress` callback of a run stopped it; of it, only a complete scan of its path is kept.

    Examples
    --------
    >>> def stop(share, text):
    ...     raise sp.errors.RunStopped("enough")
    >>> try:
    ...     sp.reconstruct(sp.rigid(np.eye(3), 1.0), [0.0, 0.0, 1.0], progress=stop)
    ... except sp.errors.RunStopped as error:
    ...     print(error)
    enough
    """


class ResultFileError(ShapePhaseError, ValueError):
    """A result file that this version cannot read: another format, or damaged. Remedy: compute it anew.

    Examples
    --------
    >>> np.savez("bad.npz", numbers=[1.0, 2.0])
    >>> try:
    ...     sp.load_motion("bad.npz")
    ... except sp.errors.ResultFileError as error:
    ...     print(str(error)[:72])
    bad.npz: not a readable motion ('header')
    """


class StudyError(ShapePhaseError, ValueError):
    """A study that cannot be computed as it is described: its file, its axes, its outputs.

    Remedy: the message names the entry and what it may be; nothing was computed.

    Examples
    --------
    >>> try:
    ...     sp.study.Study("cat", "cat_righting", {"momentum_z": []})
    ... except sp.errors.StudyError as error:
    ...     print(error)
    over.momentum_z: a grid needs one value or more
    """


class StudyStoreError(StudyError, ResultFileError):
    """A store that a study cannot write to: it is another study's, is in use, or was not made by this library.

    Remedy: another place for the new store, or `resume=True` with the study that began it.

    Examples
    --------
    >>> try:
    ...     sp.study.open_study("nowhere.zarr")
    ... except sp.errors.StudyStoreError as error:
    ...     print(error)
    nowhere.zarr: there is no store of a study
    """


class SchedulerLostError(ShapePhaseError, ConnectionError):
    """The scheduler of a cluster cannot be reached, or is gone; what was stored is kept.

    Remedy: start it again, and run the study with `resume=True`.
    """


class CompilerError(ShapePhaseError, RuntimeError):
    """The steps could not be compiled.

    Causes: a Numba that does not go with this NumPy, no folder that only this user may write to. Remedy: another
    version of Numba, another folder in $XDG_CACHE_HOME; or none: everything works without compiled steps, slowly.
    """


class LocalFunctionError(ShapePhaseError, PicklingError):
    """A path, deformation or gauge made of a lambda, or of a function inside another, cannot be pickled.

    Remedy: define the function at the top of a module, where another process finds it by its name; or save the motion.

    Examples
    --------
    >>> import pickle
    >>> path = sp.ShapePath.function(lambda t: (np.sin(t)[:, None], np.cos(t)[:, None]), 1.0)
    >>> try:
    ...     pickle.dumps(path)
    ... except sp.errors.LocalFunctionError as error:
    ...     print(str(error)[:40])
    a path made of '<lambda>' cannot be pick
    """


class PlanNotFound(ShapePhaseError, ArithmeticError):
    """No motion of the joints was found that reaches the goal.

    Causes: a turn that no motion makes (a loop of one joint), joint or rate limits too tight for it, too short a time,
    or a search that did not converge. Remedy: loosen the limits, give more time, iterations or starts.

    Attributes
    ----------
    best : the best try, a `Plan` that misses the goal; None if there was none

    Examples
    --------
    >>> error = sp.errors.PlanNotFound("no motion reaches the goal", best="the best try")
    >>> print(error, "-", error.best)
    no motion reaches the goal - the best try
    """

    def __init__(self, message: str, best: object = None) -> None:
        super().__init__(message)
        self.best = best


class UnreachableGoalError(PlanNotFound):
    """A goal that no motion of the joints can reach, however long it takes: nothing was searched for.

    Causes: joints that are all held, or whose loops turn the body not at all or about one axis alone, a planar motion.
    Remedy: the message says what can be reached, and the goal nearest to the wanted one; let other joints move, or
    choose another goal, end or momentum.

    Examples
    --------
    >>> cat, goal = sp.load_body("cat_two_halves"), sp.so3.exp(np.array([1.0, 0.0, 0.0]))
    >>> try:
    ...     sp.plan_reorientation(cat, goal, joints=["waist_pitch"])
    ... except sp.errors.UnreachableGoalError as error:
    ...     print(str(error)[:72])
    no motion of the joints of cat_two_halves reaches the goal: only waist_p
    """


class DesignNotFound(ShapePhaseError, ArithmeticError):
    """No member of a family of deformations was found that meets the goal.

    Remedy: where `cover` shows that there is none, another goal, or a wider box; the message says how near the family
    comes. Else also more members, or another start.

    Attributes
    ----------
    best : `Design` of the nearest member, which misses the goal
    cover : enclosures that exclude every member, a `Cover`; None where it is not known whether there is one

    Examples
    --------
    >>> error = sp.errors.DesignNotFound("no member meets theta = 1 rad", best="the nearest member")
    >>> print(error, "-", error.best)
    no member meets theta = 1 rad - the nearest member
    """

    def __init__(self, message: str, best: object = None, cover: object = None) -> None:
        super().__init__(message)
        self.best, self.cover = best, cover


class UnphysicalInertiaWarning(UserWarning):
    """Links whose inertia is doubtful, accepted because the caller allows it or because it does no harm.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings(record=True) as said:
    ...     warnings.simplefilter("always")
    ...     _ = sp.deformation.rigid_part(1.0, np.diag([1.0, 1.0, 4.0]), on_unphysical="warn")
    >>> len(said), said[0].category.__name__
    (1, 'UnphysicalInertiaWarning')
    """


class ImplausibleBodyWarning(UserWarning):
    """Numbers of a body that hardly any real one has: other units, or a slip in its file."""


class IgnoredElementWarning(UserWarning):
    """An element of a file that has no meaning for a free-floating body; the message names it."""


class VisualWarning(UserWarning):
    """A part of a body is not drawn as in its file: a mesh, a faulty element, or a changed file."""


class CompiledCodeWarning(UserWarning):
    """Compiled steps cannot be kept, or not be used; the interpreted ones give the same results, slowly."""


class TrajectoryWarning(UserWarning):
    """Something in a recorded motion that can be read but is probably not meant: limits, gaps, whole turns."""


class UndeclaredBreakWarning(TrajectoryWarning):
    """A function of time has kinks that were not declared as breaks; they were located, and are named."""


class UnstatedLimitWarning(UserWarning):
    """A body's file states no limit of a joint's rate, so that a plan may move it at any rate."""


def unknown_name(
    kind: str, name: str, valid: Iterable[str], error: type[UnknownNameError] = UnknownNameError
) -> UnknownNameError:
    """The error for a name that does not exist, with the nearest and all valid names.

    Examples
    --------
    >>> print(sp.errors.unknown_name("gauge", "bass", ["base", "principal"]))
    unknown gauge 'bass'. Did you mean 'base'? Valid: base, principal
    """
    choices = [str(v) for v in valid]
    near = difflib.get_close_matches(name, choices, n=1) if isinstance(name, str) else []
    hint = f" Did you mean {near[0]!r}?" if near else ""
    listed = ", ".join(choices) if choices else "none"
    if isinstance(name, str) and len(name) > _LONGEST_NAME:
        name = f"{name[:_LONGEST_SHOWN]}..."
    shown = repr(name) if isinstance(name, str) else f"(a name is needed): {value_text(name)}"
    return error(f"unknown {kind} {shown}.{hint} Valid: {listed}")
