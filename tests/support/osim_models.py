"""OpenSim models built as those for gait: a spline knee that slides, a patella that follows it, locked toes."""

from __future__ import annotations

from collections.abc import Iterable


def body(name: str, mass: float, centre: str, inertia: str) -> str:
    return (
        f'<Body name="{name}"><mass>{mass}</mass><mass_center>{centre}</mass_center><inertia>{inertia}</inertia></Body>'
    )


def coordinate(name: str, low: float = -1.5, high: float = 1.5, *, value: float = 0.0, **flags: bool) -> str:
    said = "".join(
        f"<{flag}>{str(flags.get(flag, flag == 'clamped')).lower()}</{flag}>" for flag in ("clamped", "locked")
    )
    span = f"<default_value>{value}</default_value><range>{low} {high}</range>"
    return f'<Coordinate name="{name}">{span}{said}</Coordinate>'


def joint(
    kind: str,
    name: str,
    parent: str,
    child: str,
    coordinates: Iterable[str] = (),
    *,
    places: tuple[str, str] = ("0 0 0", "0 0 0"),
    turns: tuple[str, str] = ("0 0 0", "0 0 0"),
    transform: str = "",
) -> str:
    """Frames in parent and child with their places and orientations (angles about x, y, z of the moved axes)."""
    frames = "".join(
        f'<PhysicalOffsetFrame name="{frame}_offset"><socket_parent>{path}</socket_parent>'
        f"<translation>{place}</translation><orientation>{turn}</orientation></PhysicalOffsetFrame>"
        for frame, path, place, turn in zip(
            (parent, child),
            ("/ground" if parent == "ground" else f"/bodyset/{parent}", f"/bodyset/{child}"),
            places,
            turns,
            strict=True,
        )
    )
    inner = f"<SpatialTransform>{transform}</SpatialTransform>" if transform else ""
    return (
        f'<{kind} name="{name}"><socket_parent_frame>{parent}_offset</socket_parent_frame>'
        f"<socket_child_frame>{child}_offset</socket_child_frame><coordinates>{''.join(coordinates)}</coordinates>"
        f"<frames>{frames}</frames>{inner}</{kind}>"
    )


def axis(number: int, direction: str, function: str, names: str = "") -> str:
    """One of the six axes of a custom joint: 0, 1, 2 turn, 3, 4, 5 slide."""
    kind = f"rotation{number + 1}" if number < 3 else f"translation{number - 2}"
    return (
        f'<TransformAxis name="{kind}"><coordinates>{names}</coordinates><axis>{direction}</axis>{function}'
        "</TransformAxis>"
    )


def axes(*given: str) -> str:
    """All six, those that are not given at rest."""
    directions = ("1 0 0", "0 1 0", "0 0 1")
    kinds = [f"{word}{k}" for word in ("rotation", "translation") for k in (1, 2, 3)]
    at_rest = [axis(k, directions[k % 3], constant(0.0)) for k in range(6)]
    found = [next((one for one in given if f'name="{kind}"' in one), at_rest[k]) for k, kind in enumerate(kinds)]
    return "".join(found)


def constant(value: float) -> str:
    return f'<Constant name="function"><value>{value}</value></Constant>'


def line(*coefficients: float) -> str:
    return f'<LinearFunction name="function"><coefficients>{_words(coefficients)}</coefficients></LinearFunction>'


def points(kind: str, x: Iterable[float], y: Iterable[float]) -> str:
    return f'<{kind} name="function"><x>{_words(x)}</x><y>{_words(y)}</y></{kind}>'


def gcv(x: Iterable[float], y: Iterable[float], half_order: int = 2) -> str:
    """A natural spline of degree 2 half_order - 1."""
    return (
        f'<GCVSpline name="function"><half_order>{half_order}</half_order><error_variance>0</error_variance>'
        f"<x>{_words(x)}</x><y>{_words(y)}</y></GCVSpline>"
    )


def polynomial(*coefficients: float) -> str:
    """The highest power first, as OpenSim has it."""
    words = _words(coefficients)
    return f'<PolynomialFunction name="function"><coefficients>{words}</coefficients></PolynomialFunction>'


def scaled(function: str, factor: float) -> str:
    return (
        f'<MultiplierFunction name="function"><function>{function}</function><scale>{factor}</scale>'
        "</MultiplierFunction>"
    )


def coupler(name: str, dependent: str, independent: str, function: str) -> str:
    return (
        f'<CoordinateCouplerConstraint name="{name}"><isEnforced>true</isEnforced>'
        f"<coupled_coordinates_function>{function}</coupled_coordinates_function>"
        f"<independent_coordinate_names>{independent}</independent_coordinate_names>"
        f"<dependent_coordinate_name>{dependent}</dependent_coordinate_name></CoordinateCouplerConstraint>"
    )


def model(bodies: Iterable[str], joints: Iterable[str], couplers: Iterable[str] = (), *, version: int = 40000) -> str:
    return (
        f'<?xml version="1.0" encoding="UTF-8" ?>\n<OpenSimDocument Version="{version}">\n<Model name="tested">\n'
        f'<Ground name="ground"/>\n<BodySet name="bodyset"><objects>\n{_lines(bodies)}</objects></BodySet>\n'
        f'<JointSet name="jointset"><objects>\n{_lines(joints)}</objects></JointSet>\n'
        f'<ConstraintSet name="constraintset"><objects>\n{_lines(couplers)}</objects></ConstraintSet>\n'
        "</Model>\n</OpenSimDocument>\n"
    )


def _lines(parts: Iterable[str]) -> str:
    return "".join(f"{part}\n" for part in parts)


def _words(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)


_KNEE = (-2.0944, -1.22173, -0.523599, -0.174533, 0.0, 0.174533)
_SLIDES = (-0.0032, 0.00411, 0.0179, 0.00411, -0.0032, -0.0049)
_SINKS = (-0.4226, -0.4082, -0.399, -0.3976, -0.3966, -0.395)
_SWINGS = (0.05, 0.03, 0.02, 0.01, 0.0, -0.02)
PELVIS = ("pelvis_tilt", "pelvis_list", "pelvis_rotation", "pelvis_tx", "pelvis_ty", "pelvis_tz")
ROOT = joint(
    "CustomJoint",
    "ground_pelvis",
    "ground",
    "pelvis",
    [coordinate(name, -3.0, 3.0, clamped=False) for name in PELVIS],
    places=("0 0.1 0", "0 0 0"),
    transform="".join(
        axis(k, direction, line(1.0, 0.0), name)
        for k, (direction, name) in enumerate(
            zip(("0 0 1", "1 0 0", "0 1 0", "1 0 0", "0 1 0", "0 0 1"), PELVIS, strict=True)
        )
    ),
)


def gait() -> str:
    """Trunk, a right leg with its knee and patella, a left one of hinges, an arm and what it holds: 11 bodies."""
    bodies = (
        body("pelvis", 11.777, "-0.0707 0.01 0.002", "0.1028 0.0871 0.0579 0.001 -0.002 0.0005"),
        body("femur_r", 9.3014, "0 -0.17 0.01", "0.1339 0.0351 0.1412 0.002 0 0"),
        body("tibia_r", 3.7075, "0.01 -0.1867 0", "0.0504 0.0051 0.0511 0 0.0003 0"),
        body("patella_r", 0.0862, "0.0018 0.0264 0", "0.0000287 0.00001311 0.0000287 0 0 0"),
        body("talus_r", 0.1, "0 0 0", "0.001 0.001 0.001 0 0 0"),
        body("calcn_r", 1.25, "0.1 0.03 0", "0.0014 0.0039 0.0041 0 0 0"),
        body("toes_r", 0.2166, "0.0346 0.006 -0.0175", "0.0001 0.0002 0.0001 0 0 0"),
        body("femur_l", 9.3014, "0 -0.17 -0.01", "0.1339 0.0351 0.1412 -0.002 0 0"),
        body("tibia_l", 3.7075, "0.01 -0.1867 0", "0.0504 0.0051 0.0511 0 0 0"),
        body("torso", 26.8266, "-0.03 0.32 0.01", "1.4745 0.7555 1.4314 0.01 0.02 -0.03"),
        body("humerus_r", 2.0325, "0 -0.1645 0", "0.011946 0.004121 0.013409 0 0 0"),
        body("load", 1.5, "0.1 0 0.02", "0.01 0.012 0.009 0 0.001 0"),
    )
    joints = (
        ROOT,
        joint(
            "CustomJoint", "hip_r", "pelvis", "femur_r",
            [coordinate("hip_flexion_r"), coordinate("hip_adduction_r", -0.9, 0.5), coordinate("hip_rotation_r")],
            places=("-0.0563 -0.0785 0.0773", "0 0 0"),
            transform=axes(
                axis(0, "0 0 1", line(1.0, 0.0), "hip_flexion_r"),
                axis(1, "1 0 0", line(1.0, 0.0), "hip_adduction_r"),
                axis(2, "0 1 0", line(-1.0, 0.02), "hip_rotation_r"),
            ),
        ),
        joint(
            "CustomJoint", "walker_knee_r", "femur_r", "tibia_r", [coordinate("knee_angle_r", -2.0944, 0.1745)],
            places=("-0.0045 -0.3959 -0.0017", "-0.0089 -0.0017 -0.0038"),
            turns=("0.016 -0.02 0.01", "-0.016 0.0237 0.0031"),
            transform=axes(
                axis(0, "0 0 1", line(1.0, 0.0), "knee_angle_r"),
                axis(1, "0.1 1 0", points("SimmSpline", _KNEE, _SWINGS), "knee_angle_r"),
                axis(2, "1 0 0", scaled(points("SimmSpline", _KNEE, _SWINGS), -0.7), "knee_angle_r"),
                axis(3, "1 0 0", scaled(points("SimmSpline", _KNEE, _SLIDES), 1.07), "knee_angle_r"),
                axis(4, "0 1 0", points("PiecewiseLinearFunction", _KNEE, _SINKS), "knee_angle_r"),
                axis(5, "0 0 1", polynomial(0.002, -0.003, 0.001), "knee_angle_r"),
            ),
        ),
        joint(
            "CustomJoint", "patellofemoral_r", "femur_r", "patella_r", [coordinate("knee_angle_r_beta", -9.0, 9.0)],
            places=("-0.0108 -0.3959 -0.0017", "0 0 0"),
            transform=axes(
                axis(2, "0 0 1", points("SimmSpline", (-3.0, -1.0, 0.0, 2.0), (-2.5, -0.9, 0.1, 1.0)),
                     "knee_angle_r_beta"),
                axis(3, "1 0 0", points("SimmSpline", (-2.0, -1.0, 0.0, 0.3), (0.01, 0.03, 0.05, 0.051)),
                     "knee_angle_r_beta"),
                axis(4, "0 1 0", points("SimmSpline", (-2.0, -1.0, 0.0), (-0.02, 0.0, 0.01)), "knee_angle_r_beta"),
                axis(5, "0 0 1", constant(0.0015)),
            ),
        ),
        joint(
            "PinJoint", "ankle_r", "tibia_r", "talus_r", [coordinate("ankle_angle_r", -0.7, 0.5)],
            places=("-0.01 -0.4 0", "0 0 0"), turns=("0.1759 -0.1052 0.0187", "0.1759 -0.1052 0.0187"),
        ),
        joint(
            "PinJoint", "subtalar_r", "talus_r", "calcn_r", [coordinate("subtalar_angle_r", value=0.1, locked=True)],
            places=("-0.0488 -0.042 0.0079", "0 0 0"), turns=("-1.7682 0.9063 1.8196", "-1.7682 0.9063 1.8196"),
        ),
        joint(
            "WeldJoint", "mtp_r", "calcn_r", "toes_r",
            places=("0.1788 -0.002 0.0011", "0.01 0 0"), turns=("-3.14159 0.6199 0", "0 0.1 0"),
        ),
        joint(
            "GimbalJoint", "hip_l", "pelvis", "femur_l",
            [coordinate("hip_x_l"), coordinate("hip_y_l", clamped=False), coordinate("hip_z_l")],
            places=("-0.0563 -0.0785 -0.0773", "0 0.01 0"), turns=("0.1 0 0.2", "0.2 0.1 0"),
        ),
        joint(
            "PinJoint", "knee_l", "femur_l", "tibia_l", [coordinate("knee_angle_l", -2.0, 0.1)],
            places=("0 -0.4 0", "0 0 0"),
        ),
        joint(
            "CustomJoint", "back", "pelvis", "torso", [coordinate("lumbar_bending"), coordinate("lumbar_extension")],
            places=("-0.1007 0.0815 0", "0 0 0"),
            transform=axes(
                axis(0, "1 0 0", line(0.4, 0.1), "lumbar_bending"),
                axis(1, "0 1 0", line(0.3, -0.2, 0.05), "lumbar_bending lumbar_extension"),
                axis(2, "0 0 1", line(1.0, 0.0), "lumbar_extension"),
            ),
        ),
        joint(
            "UniversalJoint", "shoulder_r", "torso", "humerus_r", [coordinate("arm_flex_r"), coordinate("arm_add_r")],
            places=("0.0032 0.3715 0.17", "0 0 0"), turns=("0.3 0 0", "0 0.1 0"),
        ),
        joint(
            "SliderJoint", "hold", "humerus_r", "load", [coordinate("reach", 0.0, 0.3)],
            places=("0 -0.3 0", "0.02 0 0"), turns=("0 0 0.5", "0 0.3 0"),
        ),
    )  # fmt: skip
    return model(
        bodies,
        joints,
        [coupler("patella_follows", "knee_angle_r_beta", "knee_angle_r",
                 points("SimmSpline", (-2.5, -1.5, -0.5, 0.3), (-2.3, -1.2, -0.6, 0.25)))],
    )  # fmt: skip


ACROBAT_FREE = ("roll", "pitch", "yaw", "along", "up", "across")


def acrobat() -> str:
    """A trunk that floats by a FreeJoint, and every other kind of joint and function: 8 bodies."""
    bodies = (
        body("trunk", 30.0, "0.01 0.2 0", "1.2 0.6 1.1 0.02 0 0.01"),
        body("thigh", 9.0, "0 -0.2 0.01", "0.13 0.04 0.14 0.001 0 0"),
        body("shank", 4.0, "0.01 -0.2 0", "0.05 0.006 0.051 0 0.0002 0"),
        body("foot", 1.1, "0.1 0.02 0", "0.0015 0.004 0.0042 0 0 0"),
        body("arm", 2.2, "0 -0.16 0", "0.012 0.004 0.013 0 0 0.0001"),
        body("hand", 0.5, "0 -0.06 0", "0.0009 0.0005 0.0013 0 0 0"),
        body("head", 4.6, "0.01 0.1 0", "0.02 0.018 0.024 0 0.0005 0"),
        body("pole", 3.0, "0.4 0 0.1", "0.02 0.5 0.5 0.001 0 0"),
    )
    joints = (
        joint("FreeJoint", "floating", "ground", "trunk", [coordinate(name, clamped=False) for name in ACROBAT_FREE],
              places=("0 1 0", "0.1 0.05 -0.02"), turns=("0.1 0.2 -0.3", "0.2 0 0.1")),
        joint("PlanarJoint", "hip", "trunk", "thigh",
              [coordinate("hip_bend"), coordinate("hip_along", -0.1, 0.1), coordinate("hip_up", -0.1, 0.1)],
              places=("0 -0.1 0.1", "0 0.05 0"), turns=("0.3 0.1 0", "0 0 0.2")),
        joint(
            "CustomJoint", "knee", "thigh", "shank", [coordinate("knee_bend", -1.8, 0.2), coordinate(
                "knee_play", value=0.3, locked=True)],
            places=("0 -0.4 0", "0 0.02 0"), turns=("0 0.05 0", "0.02 0 0"),
            transform=axes(
                axis(0, "0 0 1", line(-1.0, 0.1), "knee_bend"),
                axis(1, "0 1 0.2", points("SimmSpline", (-1.0, 0.0, 1.0), (0.1, 0.0, 0.2)), "knee_play"),
                axis(2, "1 0 0", constant(0.05)),
                axis(3, "1 0 0", gcv((-2.0, -1.4, -0.9, -0.3, 0.3), (0.01, 0.02, 0.015, 0.0, 0.01)), "knee_bend"),
                axis(4, "0 1 0", line(0.02, -0.01, 0.03), "knee_bend knee_play"),
            ),
        ),
        joint("PinJoint", "ankle", "shank", "foot", [coordinate("ankle_bend")], places=("0 -0.4 0", "0 0 0"),
              turns=("0.2 -0.1 0", "0.2 -0.1 0")),
        joint("GimbalJoint", "shoulder", "trunk", "arm",
              [coordinate("shoulder_x"), coordinate("shoulder_y"), coordinate("shoulder_z")],
              places=("0 0.4 0.2", "0 0.02 0")),
        joint("WeldJoint", "wrist", "arm", "hand", places=("0 -0.5 0", "0 0 0.01"), turns=("0.1 0 0", "0 0 0.2")),
        joint("UniversalJoint", "neck", "trunk", "head", [coordinate("nod"), coordinate("shake")],
              places=("0 0.5 0", "0 -0.05 0")),
        joint("SliderJoint", "grip", "hand", "pole", [coordinate("slip", -0.2, 0.2)], turns=("0 0.4 0", "0 0 0.3")),
    )  # fmt: skip
    couplers = (
        coupler("ankle_of_knee", "ankle_bend", "knee_bend", polynomial(0.1, -0.4, 0.2)),
        coupler("nod_of_ankle", "nod", "ankle_bend", line(0.5, 0.1)),
        coupler("shake_of_both", "shake", "knee_bend shoulder_y", line(0.3, -0.6, 0.05)),
    )
    return model(bodies, joints, couplers)


TWO = (
    body("trunk", 2.0, "0 0.1 0", "0.1 0.2 0.15 0 0 0"),
    body("arm", 1.0, "0.2 0 0", "0.02 0.05 0.04 0 0 0"),
)
TRUNK = ROOT.replace("pelvis_offset", "trunk_offset").replace("/bodyset/pelvis", "/bodyset/trunk")
ARM = joint("PinJoint", "elbow", "trunk", "arm", [coordinate("bend")])
