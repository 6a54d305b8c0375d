"""Options that take joints and values: all of them take the same words and the same units."""

import importlib
import json
import math

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import PlanNotFound

TURNS, SLIDES = "arm_2", "boom_extension"
SIZES = {"rad": 1.0, "deg": math.pi / 180.0, "mrad": 1e-3, "m": 1.0, "cm": 1e-2, "mm": 1e-3}


@pytest.fixture(scope="module")
def satellite():
    return sp.load_body("satellite")


@pytest.fixture
def planned(monkeypatch):
    """The arguments that `plan` hands to the search, which is not made."""
    taken = {}

    def search(*_, **arguments):
        taken.update(arguments)
        raise PlanNotFound("not searched")

    # What is imported for the first time meanwhile would keep this search.
    importlib.import_module("shapephase.optimal_control.way_back")
    monkeypatch.setattr("shapephase.optimal_control.planning.plan_reorientation", search)
    return taken


def plan_values(option):
    def values(body, words, planned, _):
        with pytest.raises(SystemExit) as ended:
            main(["plan", "satellite", "--turn", "5 about x", option, *words])
        if not planned:
            raise ended.value
        shape = planned["via"][0].shape if option == "--via" else planned["start" if option == "--from" else "end"]
        return dict(shape) if option == "--via" else dict(zip(body.joint_names, shape.tolist()))

    return values


def at_values(body, words, _, capsys):
    main(["reach", "satellite", "--pairs", "0", "--json", "--at", *words])
    return dict(zip(body.joint_names, json.loads(capsys.readouterr().out)["shape"]))


def rest_values(_body, words, _planned, capsys):
    main(["check", "satellite", "m.csv", "--rest", *words, "--rest-missing", "--json"])
    return json.loads(capsys.readouterr().out)["motion"]["recording"]["at_rest"]


OPTIONS = {
    "--at": at_values,
    "--rest": rest_values,
    "--from": plan_values("--from"),
    "--to": plan_values("--to"),
    "--via": plan_values("--via"),
}


@pytest.mark.parametrize("unit", ["", *SIZES])
@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_takes_every_unit(option, unit, satellite, planned, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    other = next(name for name in satellite.joint_names if name not in (TURNS, SLIDES))
    (tmp_path / "m.csv").write_text(f"time,{other}\n0,0\n1,0.1\n2,0\n")
    joint = SLIDES if unit in ("m", "cm", "mm") else TURNS
    values = OPTIONS[option](satellite, [f"{joint}=0.2{unit}"], planned, capsys)
    assert values[joint] == pytest.approx(0.2 * SIZES.get(unit, 1.0), abs=1e-15)


@pytest.mark.parametrize(
    ("option", "separator"),  # words of --via are postures of their own
    [*((option, ",") for option in OPTIONS), *((option, " ") for option in OPTIONS if option != "--via")],
)
def test_every_option_takes_several_joints(option, separator, satellite, planned, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    other = next(name for name in satellite.joint_names if name not in (TURNS, SLIDES))
    (tmp_path / "m.csv").write_text(f"time,{other}\n0,0\n1,0.1\n2,0\n")
    words = f"{TURNS}=10deg,{SLIDES}=5cm".replace(",", separator).split()
    values = OPTIONS[option](satellite, words, planned, capsys)
    assert (values[TURNS], values[SLIDES]) == pytest.approx((math.radians(10.0), 0.05), abs=1e-15)


REFUSED = {
    f"{TURNS}=2mm": f"{TURNS}: '2mm' is in mm, and the joint turns; give it in rad, deg",
    f"{SLIDES}=2deg": f"{SLIDES}: '2deg' is in deg, and the joint slides",
    f"{TURNS}=2deg/s": "a number is needed",
    f"{TURNS}=nan": "a number is needed",
    f"{TURNS}=1e999": "a finite number is needed",
    f"{TURNS}=": "JOINT=VALUE is needed",
    "=1": "JOINT=VALUE is needed",
    f"{TURNS}=1,{TURNS}=2": f"joint '{TURNS}' stands twice",
    "elbow=1": "unknown joint of satellite 'elbow'",
}


@pytest.mark.parametrize("words", REFUSED)
@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_refuses_the_same_words(option, words, satellite, planned, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.csv").write_text("time,arm_1\n0,0\n1,0.1\n2,0\n")
    with pytest.raises(SystemExit) as ended:
        OPTIONS[option](satellite, [words], planned, capsys)
    assert ended.value.code == 2
    assert REFUSED[words] in capsys.readouterr().err
    assert not planned


RATES = {"--rate-limit": "/s", "--acceleration-limit": "/s^2", "--jerk-limit": "/s^3"}
FIELDS = {option: f"{option.strip('-').replace('-', '_')}s" for option in RATES}


@pytest.mark.parametrize("unit", ["rad", "deg", "mrad"])
@pytest.mark.parametrize("option", RATES)
def test_limits_are_per_second(option, unit, planned):
    cat = ("plan", "cat_two_halves", "--turn", "5 about x")
    with pytest.raises(SystemExit):
        main([*cat, option, f"150{unit}{RATES[option]}"])
    assert getattr(planned["limits"], FIELDS[option]) == pytest.approx(np.full(3, 150.0 * SIZES[unit]), rel=1e-15)
    with pytest.raises(SystemExit):
        main([*cat, option, f"waist_yaw=150{unit}{RATES[option]}", "waist_pitch=2", "waist_roll=3"])
    names = sp.load_body("cat_two_halves").joint_names
    given = dict(zip(names, getattr(planned["limits"], FIELDS[option])))
    assert given == pytest.approx({"waist_yaw": 150.0 * SIZES[unit], "waist_pitch": 2.0, "waist_roll": 3.0}, rel=1e-15)


def test_limits_of_other_joints_are_those_of_the_file(planned, capsys):
    cat = ("plan", "cat_two_halves", "--turn", "5 about x")
    with pytest.raises(SystemExit):
        main([*cat, "--rate-limit", "waist_yaw=2"])
    body, limits = sp.load_body("cat_two_halves"), planned["limits"].rate_limits
    known = body.rate_limits.copy()
    known[body.joint_index("waist_yaw")] = 2.0
    assert limits.tolist() == known.tolist()
    for words, said in {
        ("--jerk-limit", "waist_yaw=2"): "a limit is needed for each joint",
        ("--rate-limit", "100deg"): "as 2 or 100deg/s, got '100deg'",
        ("--rate-limit", "waist_yaw=1m/s"): "the joint turns",
        ("--rate-limit", "-1"): "rate_limits",
    }.items():
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main([*cat, *words])
        assert ended.value.code == 2
        assert said in capsys.readouterr().err
