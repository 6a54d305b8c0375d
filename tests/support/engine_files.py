"""Files in formats that other programs own: an acrobat of bioMod, and the measurements of an invented person."""

from __future__ import annotations

_PELVIS = """segment Pelvis
	translations	xyz
	rotations	xyz
	rangesQ -10 10 -10 10 -10 10 -7 7 -2 2 -9 9
	mass 22.5
	inertia
		0.2 0.01 0
		0.01 0.25 0.002
		0 0.002 0.15
	com 0 0.01 0.12
	meshfile pelvis.bvh // not there
endsegment
"""
_ABOVE = """/* An acrobat,
   of five parts. */
version 4

gravity 0 0 -9.81

"""
_BELOW = """
segment Thorax
	parent Pelvis
	RTinMatrix 1
	RT
		1 0 0 0.01
		0 0.980067 -0.198669 0.02
		0 0.198669 0.980067 0.25
		0 0 0 1
	rotations	xz
	rangesQ -0.5 0.9
		-1 1
	mass 30
	inertia
		0.4 0 0
		0 0.35 0
		0 0 0.2
	com 0 0 0.2
endsegment

segment RightArm
	parent Thorax
	RT 0.1 -0.2 0.3 xyz -0.2 0 0.35
	rotations	zyx
	mass 4
	inertia
		0.03 0 0
		0 0.03 0
		0 0 0.003
	com 0 0 -0.25
endsegment

segment Slider
	parent RightArm
	rt 0 0 0 xyz 0 0 -0.5
	translations z
	mass 0.5
	inertia
		0.001 0 0
		0 0.001 0
		0 0 0.001
	com 0 0 -0.02
endsegment

segment Hand
	parent Slider
	rt 0.3 0 0 xyz 0 0.1 -0.05
	mass 0.25
	inertia
		0.0002 0 0
		0 0.0003 0
		0 0 0.0001
	com 0.01 0 -0.02
endsegment
"""
ACROBAT = _ABOVE + _PELVIS + _BELOW
"""Every kind of joint that bioMod has but quaternions, and a frame that is orthonormal to six digits."""
MASSLESS_ROOT = (
    _ABOVE
    + "segment Float\n\ttranslations xyz\nendsegment\nsegment Turn\n\tparent Float\n\trt 0.2 0 0 xyz 0 0 0\n"
    + "\trotations yxz\nendsegment\n"
    + _PELVIS.replace("segment Pelvis", "segment Pelvis\n\tparent Turn").replace("translations	xyz", "").replace(
        "rotations	xyz", ""
    ).replace("rangesQ -10 10 -10 10 -10 10 -7 7 -2 2 -9 9", "")
    + _BELOW
)  # fmt: skip
"""The same, its free base spread over two segments without mass."""

_TORSO = {
    "Ls1L": 0.20,
    "Ls2L": 0.30,
    "Ls3L": 0.44,
    "Ls4L": 0.56,
    "Ls5L": 0.60,
    "Ls6L": 0.16,
    "Ls7L": 0.23,
    "Ls8L": 0.28,
    "Ls0p": 0.95,
    "Ls1p": 0.85,
    "Ls2p": 0.86,
    "Ls3p": 0.95,
    "Ls5p": 0.38,
    "Ls6p": 0.50,
    "Ls7p": 0.56,
    "Ls0w": 0.34,
    "Ls1w": 0.30,
    "Ls2w": 0.30,
    "Ls3w": 0.32,
    "Ls4w": 0.35,
    "Ls4d": 0.18,
}
_ARM = {
    "2L": 0.28,
    "3L": 0.36,
    "4L": 0.54,
    "5L": 0.06,
    "6L": 0.10,
    "7L": 0.19,
    "0p": 0.36,
    "1p": 0.30,
    "2p": 0.27,
    "3p": 0.26,
    "4p": 0.17,
    "5p": 0.21,
    "6p": 0.20,
    "7p": 0.15,
    "4w": 0.055,
    "5w": 0.085,
    "6w": 0.085,
    "7w": 0.06,
}
_LEG = {
    "1L": 0.12,
    "3L": 0.43,
    "4L": 0.56,
    "5L": 0.84,
    "6L": 0.06,
    "8L": 0.17,
    "9L": 0.24,
    "1p": 0.58,
    "2p": 0.50,
    "3p": 0.38,
    "4p": 0.37,
    "5p": 0.23,
    "6p": 0.30,
    "7p": 0.25,
    "8p": 0.24,
    "9p": 0.17,
    "8w": 0.095,
    "9w": 0.07,
    "6d": 0.11,
}
MEASUREMENTS = (
    _TORSO
    | {f"L{side}{name}": value for side in "ab" for name, value in _ARM.items()}
    | {f"L{side}{name}": value * (1.02 if side == "k" else 1.0) for side in "jk" for name, value in _LEG.items()}
)
"""[m] the ninety-five of Yeadon's model; one leg is a little larger, which the package evens out."""


def measured(total: float | None = 70.0, **changes: object) -> str:
    """A file of measurements, with a mass of the whole [kg], and some entries changed; None leaves one out."""
    entries = MEASUREMENTS | {"measurementconversionfactor": 1, "totalmass": total} | changes
    return "".join(f"{name}: {value}\n" for name, value in entries.items() if value is not None)
