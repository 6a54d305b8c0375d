"""A motion as a data set of xarray, and in files of samples: CSV, Parquet, NetCDF, MATLAB, HDF5, MCAP."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_file_name, check_flag, check_keywords, check_object
from ..arrays import Array
from ..dynamics.moving_body import body_and_path
from ..errors import MissingExtraError, ShapeError, unknown_name
from ..files import write_whole
from ..provenance import provenance
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ._ros_bag import mcap_bag, whole_nanoseconds
from ._whole_motion import Fall, checked_times, continued_quaternions, whole_motion

_AXES = ("x", "y", "z")
_QUATERNION = ("qx", "qy", "qz", "qw")
_MRP = ("base_mrp_1", "base_mrp_2", "base_mrp_3")
_TURNS = ("somersault", "tilt", "twist")
_MATLAB = "MATLAB 5.0 MAT-file, a motion written by shapephase"
_MATLAB_TEXT = 116  # bytes of text at the beginning of a MATLAB file


class _Samples(dict[str, tuple[Array, str, str]]):
    """Arrays by name, each with the dimension of its columns ("" for none) and its unit."""

    joint_names: tuple[str, ...] = ()
    joint_units: tuple[str, ...] = ()
    link_axes: tuple[str, ...] = ()
    wheels: tuple[str, ...] = ()
    base_link: str = "base_link"
    attributes: dict[str, Any]


def motion_dataset(motion: Motion | ForcedMotion, times: ArrayLike | None = None, **fall: ArrayLike) -> Any:
    """One motion as an `xarray.Dataset` along time: base, joints, their rates; `motion.to_xarray()`.

    Variables have their units as attributes. `base_quat_xyzw` (time, quaternion), `base_position` and, where the body
    has joints along a path, `base_velocity` (time, axis) are in inertial axes, `angular_velocity` (time, axis) in base
    axes; `shapes` and `shape_rates` (time, joint) are those of the independent joints, wheels from an angle of zero at
    the start; `wheel_speeds` (time, wheel) those of wheels left out of the path. Where somersaults are counted
    (`Motion.counted_axes`), `turns` and `turn_errors` (time, turn) are somersault, tilt and twist.

    Parameters
    ----------
    motion : a single one
    times : (N,) [s]; None: 201 even times
    fall : start, velocity, gravity as in `Motion.base_position`

    Raises
    ------
    MissingExtraError
        Without xarray.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 2.0), [0.0, 0.0, 5.0])
    >>> found = sp.exports.motion_dataset(motion, [0.0, 1.0])
    >>> print(found.angular_velocity.sel(axis="z").values.round(9), found.angular_velocity.units)
    [2. 2.] rad/s
    """
    check_keywords(fall, motion_dataset)
    return _dataset(_samples(motion, times, fall, links=False, mrp=False))


def export_motion(
    motion: Motion | ForcedMotion,
    path: str | os.PathLike[str],
    times: ArrayLike | None = None,
    *,
    links: bool = False,
    mrp: bool = False,
    **fall: ArrayLike,
) -> None:
    """Write samples of one motion, base and joints, to a file in the format of its ending.

    - `.csv`, `.parquet`: one row a sample; labels of joints contain their units, in Parquet as metadata `unit`.
    - `.nc`: the data set of `Motion.to_xarray` as NetCDF.
    - `.mat`, `.h5`: the same as arrays by their names, with `joint_names`.
    - `.mcap`: a bag of ROS 2 with the topics /joint_states, /base_pose and /tf (world to the base's link), at times
      rounded to nanoseconds.

    All hold every digit, and all but `.nc` are read by `read_recorded_motion`, `.mcap` without the base. `Motion.save`
    keeps the whole motion, to be evaluated at any time.

    Parameters
    ----------
    motion : a single one
    times : (N,) [s]; None: 201 even times
    links : True to write the angular momentum of each link about the centre of mass, too, inertial axes
    mrp : True to write modified Rodrigues parameters of the base instead of quaternions, see `so3.mrp_from_quat`; not
        for `.mcap`
    fall : start, velocity, gravity as in `Motion.base_position`

    Raises
    ------
    MissingExtraError
        Without xarray, pyarrow, h5py or rosbags, for the formats that need them.
    UnknownNameError
        For another ending.
    ShapeError
        If `.mcap` is to have `links` or `mrp`.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> sp.export_motion(motion, "turn.csv", np.linspace(0.0, 1.0, 101))
    >>> print(sp.read_recorded_motion("turn.csv", cat).base_attitude.shape)
    (101, 3, 3)
    """
    check_file_name(path, "path")
    check_flag(links, "links")
    check_flag(mrp, "mrp")
    check_keywords(fall, export_motion)
    where = Path(path)
    if where.suffix.lower() not in ENDINGS:
        raise unknown_name(f"ending of the file {where}:", where.suffix, ENDINGS)
    if where.suffix.lower() == ".mcap":
        if mrp or links:
            raise ShapeError("mrp, links: messages of ROS have quaternions, and no momenta of links; write a table")
        times = whole_nanoseconds(checked_times(motion, times), motion.duration)
    content = _WRITERS[where.suffix.lower()](_samples(motion, times, fall, links=links, mrp=mrp))
    write_whole(where, lambda stream: stream.write(content))


def _extra(name: str, needed: str, extra: str = "data") -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise MissingExtraError(f"{needed}; install it with: pip install 'shapephase[{extra}]'") from None


def _samples(
    motion: Motion | ForcedMotion, times: ArrayLike | None, fall: dict[str, ArrayLike], *, links: bool, mrp: bool
) -> _Samples:
    at, falling, samples = checked_times(motion, times), Fall.of(**fall), _Samples()
    samples["time"] = at, "", "s"
    if body_and_path(motion) is None:
        attitude = motion.attitude(at)
        centre = so3.apply(attitude, motion.deformation.centre_of_mass(at))
        samples["base_quat_xyzw"] = continued_quaternions(attitude), "quaternion", ""
        samples["angular_velocity"] = motion.angular_velocity(at), "axis", "rad/s"
        samples["base_position"] = falling.centre(at) - centre, "axis", "m"
    else:
        whole = whole_motion(motion, at, falling)
        samples.joint_names, samples.joint_units = whole.body.joint_names, whole.body.joint_units
        samples.base_link = whole.body.link_names[0]
        angles = set(samples.joint_units) == {"rad"}
        samples["base_quat_xyzw"] = whole.quat_xyzw, "quaternion", ""
        samples["angular_velocity"] = whole.angular_velocity, "axis", "rad/s"
        samples["base_position"] = whole.position, "axis", "m"
        samples["base_velocity"] = whole.world_velocity, "axis", "m/s"
        samples["shapes"] = whole.shapes, "joint", "rad" * angles
        samples["shape_rates"] = whole.shape_rates, "joint", "rad/s" * angles
        if whole.wheels:
            columns = [whole.body.joint_index(wheel) for wheel in whole.wheels]
            samples.wheels = whole.wheels
            samples["wheel_speeds"] = whole.shape_rates[:, columns], "wheel", "rad/s"
    if mrp:
        samples["base_mrp"] = so3.mrp_from_quat(samples.pop("base_quat_xyzw")[0]), "mrp", ""
    if isinstance(motion, Motion) and motion.counted_axes() is not None:
        samples["turns"] = np.stack(motion.somersault_tilt_twist(at), axis=-1), "turn", "rad"
        samples["turn_errors"] = np.stack(motion.somersault_errors(at), axis=-1), "turn", "rad"
    if links:
        check_object(motion, "Motion", "motion")
        found = cast("Motion", motion).segment_momentum(at)
        samples.link_axes = tuple(f"{link}_momentum_{axis}" for link in found.links for axis in _AXES)
        samples["link_momentum"] = found.by_link.reshape(len(at), -1), "link_axis", "kg m^2/s"
    momentum = motion.momentum(at) if isinstance(motion, ForcedMotion) else motion.momentum
    samples.attributes = {
        "momentum": np.asarray(momentum).reshape(-1, 3)[0].tolist(),
        "momentum_units": "kg m^2/s",
        "provenance": json.dumps(provenance(motion.deformation.made_from)),
    }
    if isinstance(motion, Motion):
        samples.attributes |= {"error_estimate": float(motion.error_estimate), "error_estimate_units": "rad"}
    return samples


def _dataset(samples: _Samples) -> Any:
    xarray = _extra("xarray", "a data set needs xarray", "study")
    labels = {
        "quaternion": _QUATERNION,
        "axis": _AXES,
        "joint": samples.joint_names,
        "turn": _TURNS,
        "link_axis": samples.link_axes,
        "wheel": samples.wheels,
        "mrp": _MRP,
    }
    variables = {
        name: (("time", dimension), values, {"units": unit} if unit else {})
        for name, (values, dimension, unit) in samples.items()
        if dimension
    }
    coordinates: dict[str, Any] = {"time": ("time", samples["time"][0], {"units": "s"})}
    coordinates |= {
        name: list(entries)
        for name, entries in labels.items()
        if any(name == variable[0][1] for variable in variables.values())
    }
    if "joint" in coordinates:
        coordinates["joint_unit"] = ("joint", list(samples.joint_units))
    return xarray.Dataset(variables, coordinates, samples.attributes)


def _columns(samples: _Samples) -> dict[str, tuple[Array, str]]:
    """Columns of a table by their names, with their units."""
    labels = {
        "base_quat_xyzw": _QUATERNION,
        "base_mrp": _MRP,
        "angular_velocity": [f"omega_{axis}_rad_s" for axis in _AXES],
        "base_position": [f"base_{axis}_m" for axis in _AXES],
        "base_velocity": [f"base_v{axis}_m_s" for axis in _AXES],
        "shapes": samples.joint_names,
        "wheel_speeds": [f"{wheel}_speed_rad_s" for wheel in samples.wheels],
        "turns": [f"{turn}_rad" for turn in _TURNS],
        "turn_errors": [f"{turn}_error_rad" for turn in _TURNS],
        "link_momentum": [f"{label}_kg_m2_s" for label in samples.link_axes],
    }
    units = {"shapes": samples.joint_units}
    table: dict[str, tuple[Array, str]] = {"time": (samples["time"][0], "s")}
    for name, columns in labels.items():
        if name in samples:
            values, _, unit = samples[name]
            column_units = units.get(name, (unit,) * len(columns))
            table |= {
                label: (np.ascontiguousarray(column), own_unit)
                for label, column, own_unit in zip(columns, values.T, column_units, strict=True)
            }
    return table


def _csv(samples: _Samples) -> bytes:
    columns, text = _columns(samples), io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    bracketed = {"time", *samples.joint_names}
    writer.writerow([f"{label} [{unit}]" if label in bracketed else label for label, (_, unit) in columns.items()])
    writer.writerows(np.column_stack([values for values, _ in columns.values()]).tolist())
    return text.getvalue().encode()


def _parquet(samples: _Samples) -> bytes:
    pyarrow, parquet = (_extra(name, "Parquet files need pyarrow") for name in ("pyarrow", "pyarrow.parquet"))
    columns = _columns(samples)
    fields = [
        pyarrow.field(label, pyarrow.float64(), metadata={"unit": unit} if unit else None)
        for label, (_, unit) in columns.items()
    ]
    about = {name: json.dumps(value) for name, value in samples.attributes.items()}
    schema = pyarrow.schema(fields, metadata=about)
    stream = io.BytesIO()
    parquet.write_table(pyarrow.table([pyarrow.array(v) for v, _ in columns.values()], schema=schema), stream)
    return stream.getvalue()


def _netcdf(samples: _Samples) -> bytes:
    return bytes(_dataset(samples).to_netcdf(engine="scipy"))


def _matlab(samples: _Samples) -> bytes:
    from scipy.io import savemat

    stream = io.BytesIO()
    arrays: dict[str, Any] = {name: values for name, (values, _, _) in samples.items()}
    if samples.joint_names:
        arrays["joint_names"] = np.array(samples.joint_names, dtype=object)
        arrays["joint_units"] = np.array(samples.joint_units, dtype=object)
    savemat(stream, arrays | samples.attributes, oned_as="column", do_compression=True)
    # The text at the start has the time of the day, by which two files of the same motion would differ.
    return _MATLAB.ljust(_MATLAB_TEXT).encode() + stream.getvalue()[_MATLAB_TEXT:]


def _hdf5(samples: _Samples) -> bytes:
    h5py = _extra("h5py", "HDF5 files need h5py")
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        for name, (values, _, unit) in samples.items():
            file[name] = values
            if unit:
                file[name].attrs["units"] = unit
        if samples.joint_names:
            file["joint_names"] = list(samples.joint_names)
            file["joint_units"] = list(samples.joint_units)
        for name, value in samples.attributes.items():
            file.attrs[name] = value
    return stream.getvalue()


def _mcap(samples: _Samples) -> bytes:
    arrays = {name: values for name, (values, _, _) in samples.items()}
    joints = (samples.joint_names, arrays["shapes"], arrays["shape_rates"]) if samples.joint_names else None
    return mcap_bag(arrays["time"], arrays["base_quat_xyzw"], arrays["base_position"], samples.base_link, joints)


_WRITERS: dict[str, Callable[[_Samples], bytes]] = {
    ".csv": _csv,
    ".parquet": _parquet,
    ".nc": _netcdf,
    ".mat": _matlab,
    ".h5": _hdf5,
    ".mcap": _mcap,
}
ENDINGS = tuple(_WRITERS)  # of the files that `export_motion` writes
