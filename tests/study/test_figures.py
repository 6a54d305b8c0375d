"""Figures of a store show its numbers: each is compared with what NumPy makes of the values and the order of cases."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from shapephase import study as room
from shapephase.cli.main import main
from shapephase.cli.outcome import ExitCode
from shapephase.errors import ShapeError, StudyError, UnknownNameError, WrongObjectError

RIGID = room.RigidBody(np.diag([1.0, 2.0, 2.5]), 3.0)
OUTPUTS = ("turn", "final_attitude")
DEGREES = 180.0 / np.pi


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Three values of x, four of y, ten draws of z, of which one case is lost."""
    grids = {"momentum_x": [0.1, 0.2, 0.3], "momentum_y": [0.0, 0.5, 1.0, 1.5]}
    study = room.Study(RIGID, over={**grids, "momentum_z": room.Normal(1.0, 0.2)}, outputs=OUTPUTS, draws=10)
    found = study.run(tmp_path_factory.mktemp("store") / "out.zarr", workers=0)
    lose(found, 7)
    return found


def lose(store, cases):
    """Store NaN for cases, and seal their chunks anew."""
    store._arrays["turn"][cases] = np.nan
    for number, seal in enumerate(store._arrays["seal"][:]):
        store._arrays["seal"][number] = np.frombuffer(store._seal(number), seal.dtype)


@pytest.fixture
def ax():
    return Figure().add_subplot()


def turns(store):
    return DEGREES * store.values("turn").reshape(3, 4, 10)


def test_a_map_has_the_median_of_the_draws_over_two_grids(store, ax):
    room.plot_study(ax, store, "turn")
    (mesh,) = ax.collections
    np.testing.assert_array_equal(np.asarray(mesh.get_array()).reshape(4, 3), np.nanmedian(turns(store), axis=2).T)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("momentum x [kg m²/s]", "momentum y [kg m²/s]")


def test_the_axes_of_a_map_are_those_asked_for(store, ax):
    room.plot_study(ax, store, "turn", along=["momentum_y", "momentum_x"])
    (mesh,) = ax.collections
    np.testing.assert_array_equal(np.asarray(mesh.get_array()).reshape(3, 4), np.nanmedian(turns(store), axis=2))
    assert ax.get_xlabel() == "momentum y [kg m²/s]"


def test_quantiles_go_along_a_grid_over_all_else(store, ax):
    room.plot_study(ax, store, "turn", along="momentum_y")
    (line,) = ax.lines
    rows = np.moveaxis(turns(store), 1, 0).reshape(4, -1)
    np.testing.assert_array_equal(line.get_xdata(), [0.0, 0.5, 1.0, 1.5])
    np.testing.assert_array_equal(line.get_ydata(), np.nanmedian(rows, axis=1))
    for band, share in zip(ax.collections, (0.05, 0.25), strict=True):
        edges = band.get_paths()[0].vertices
        for end in (share, 1.0 - share):
            expected = np.nanquantile(rows, end, axis=1)
            assert all(np.isclose(edges[:, 1], value, rtol=1e-12).any() for value in expected)


def test_a_histogram_counts_every_case_that_has_a_value(store, ax):
    room.plot_study(ax, store, "turn", kind="histogram")
    assert sum(bar.get_height() for bar in ax.patches) == 119
    assert ax.get_xlabel() == "turn [deg]"
    assert ax.lines[0].get_xdata()[0] == np.nanmedian(turns(store))


def test_a_few_values_of_one_grid_have_a_histogram_each(tmp_path, ax):
    over = {"body": ["cat", "nobody.urdf"], "momentum_z": room.Normal(0.1, 0.02)}
    (tmp_path / "nobody.urdf").write_text("")
    over["body"][1] = str(tmp_path / "nobody.urdf")
    store = room.Study("cat", "cat_righting", over, ("turn",), draws=3).run(tmp_path / "out.zarr", workers=0)
    room.plot_study(ax, store, "turn", kind="histogram")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == over["body"]


def test_an_entry_of_an_array_is_named_as_in_a_table(store, ax):
    room.plot_study(ax, store, "final_attitude_0_1", kind="histogram")
    assert ax.lines[0].get_xdata()[0] == np.median(store.values("final_attitude")[:, 0, 1])


@pytest.mark.parametrize(
    ("words", "error", "said"),
    [
        ({"output": "trun"}, UnknownNameError, "turn"),
        ({"output": "final_attitude"}, StudyError, "final_attitude_0_0"),
        ({"output": "final_attitude_0_7"}, UnknownNameError, "final_attitude_0_0"),
        ({"output": "turn", "kind": "pie"}, UnknownNameError, "histogram"),
        ({"output": "turn", "along": "momentum_z"}, UnknownNameError, "momentum_y"),
        ({"output": 3}, UnknownNameError, "turn"),
    ],
)
def test_what_cannot_be_drawn_is_said(store, ax, words, error, said):
    with pytest.raises(error, match=said):
        room.plot_study(ax, store, **words)


def test_wrong_objects_and_studies_without_grids(store, ax, tmp_path):
    with pytest.raises(ShapeError, match="axes"):
        room.plot_study("axes", store, "turn")
    with pytest.raises(WrongObjectError, match="StudyStore"):
        room.plot_study(ax, "out.zarr", "turn")
    study = room.Study(RIGID, over={"momentum": room.Directions(1.0)}, outputs=("turn",), draws=4, chunk=2)
    one = study.run(tmp_path / "out.zarr", workers=0)
    with pytest.raises(StudyError, match="grids"):
        room.plot_study(ax, one, "turn", kind="quantiles")
    lose(one, slice(None))
    with pytest.raises(StudyError, match="value"):
        room.plot_study(ax, one, "turn")


def test_the_command_writes_the_figure(store, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    main(["plot", "sweep", str(store.path), "turn", "--along", "momentum_x", "--out", "turn.svg"])
    assert "momentum x" in (tmp_path / "turn.svg").read_text()
    with pytest.raises(SystemExit) as ended:
        main(["plot", "sweep", str(store.path), "turn", "--kind", "pie", "--out", "other.svg"])
    assert ended.value.code == ExitCode.USAGE
    assert capsys.readouterr().err.count("\n") == 2
    assert not (tmp_path / "other.svg").exists()
