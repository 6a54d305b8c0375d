"""`shapephase sweep`: a study of very many cases from a file, what its store holds, in other formats, and figures."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

from ..errors import ShapeError
from .options import BODY_DEFAULTS, PRINT_DEFAULTS, BodyOptions, FigureFile, PrintOptions, option
from .outcome import FIGURE_ENDINGS, FIGURE_HEIGHT, ExitCode, Outcome, check_writable
from .progress import steps
from .terminal import Verbosity, say, write_file

if TYPE_CHECKING:
    from ..study.store import StudyStore

sweep_app = App(name="sweep", help_format="markdown")
_MOST = 20  # complaints shown


@sweep_app.default
def sweep_command(
    study: str,
    /,
    *,
    store: Annotated[
        str,
        Parameter(help="The folder of results, a new one without --resume; for example `--store out.zarr`."),
    ],
    scheduler: Annotated[
        str | None,
        option(
            "Compute on the cluster of this Dask scheduler; without it on this machine. For example "
            "`--scheduler tcp://10.0.0.1:8786`.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        option(
            "Processes of this machine, without unit; else one for each processor. For example `--workers 4`.",
        ),
    ] = None,
    resume: Annotated[
        bool, Parameter(negative="", help="Go on with a store that is there; for example `--resume`.")
    ] = False,
    retry: Annotated[
        Literal["failed"] | None,
        option(
            "Go on with a store that is there, and compute cases that failed again; for example `--retry failed`.",
        ),
    ] = None,
    floating: BodyOptions = BODY_DEFAULTS,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Compute the cases of a study in a TOML file, on all processors or on a cluster, into a Zarr store.

    After Ctrl-C, continue with --resume. Exit code 11: cases failed; the others are stored.

    Parameters
    ----------
    study
        The file, as of `shapephase.study.read_study`; for example `study.toml`.
    """
    from ..integrator.machine_code import expect_much
    from ..study.dask_client import connected
    from ..study.store import open_study
    from ..study.study_file import read_study

    # Cases have the same bits whether they are computed here, in other processes, or by a program.
    expect_much()
    if workers is not None and (scheduler is not None or workers < 1):
        raise ShapeError(f"--workers: a whole number above 0, and no --scheduler beside it, is needed, got {workers}")
    read = replace(read_study(study), **floating.loading)
    try:
        with steps(1) as work, nullcontext() if scheduler is None else connected(scheduler) as client:
            work.begin(f"computing {read.cases} cases")

            def watch(share: float, text: str) -> None:
                say(f"shapephase: {text}", Verbosity.VERBOSE)
                work.watch(share, text)

            filled = read.run(store, client, workers=workers, resume=resume, retry=retry, progress=watch)
    except KeyboardInterrupt:
        if Path(store).exists():
            kept = open_study(store)
            done = kept.cases - kept.counts()["missing"]
            say(f"shapephase: {done} of {kept.cases} cases are stored; --resume goes on")
        raise
    outcome = _report(filled)
    return replace(outcome, code=ExitCode.FAILED_CASES) if outcome.data["failed"] else outcome


@sweep_app.command(name="status")
def status_command(store: str, /, *, printing: PrintOptions = PRINT_DEFAULTS) -> Outcome:  # noqa: ARG001
    """Say what the store of a study holds.

    Parameters
    ----------
    store
        The folder; for example `out.zarr`.
    """
    from ..study.store import open_study

    return _report(open_study(store))


@sweep_app.command(name="export")
def export_command(
    store: str,
    /,
    *,
    out: Annotated[
        Path,
        Parameter(help="Write a table (.parquet, .csv) or arrays (.nc) to this file; for example `--out out.nc`."),
    ],
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Write what the store of a study holds to a NetCDF, Parquet or CSV file.

    Parameters
    ----------
    store
        The folder; for example `out.zarr`.
    """
    from ..study.export import export_study
    from ..study.store import open_study

    check_writable(out, "--out", ".nc", ".parquet", ".csv")
    write_file(out, lambda file: export_study(open_study(store), file))
    return Outcome("", {"file": str(out)})


def plot_study_command(
    store: str,
    output: str,
    /,
    *,
    out: FigureFile,
    kind: Annotated[
        str | None,
        option(
            "What is drawn, a histogram, quantiles along a grid, or a map over two, without unit; else what the "
            "study's grids permit. For example `--kind quantiles`.",
        ),
    ] = None,
    along: Annotated[
        list[str] | None,
        option(
            "A grid that is an axis of the figure, without unit, once or twice; else the first. For example "
            "`--along momentum_z`.",
        ),
    ] = None,
    printing: PrintOptions = PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Draw one output of a study, one column wide: how it is spread, its quantiles along a grid, or a map over two.

    Parameters
    ----------
    store
        The folder; for example `out.zarr`.
    output
        What is drawn, an output of the study, or an entry such as `final_attitude_0_1`; for example `turn`.
    """
    from ..plots.plot_style import column_axes, write_axes
    from ..study.figures import plot_study
    from ..study.store import open_study

    check_writable(out, "--out", *FIGURE_ENDINGS)
    ax = plot_study(column_axes(FIGURE_HEIGHT), open_study(store), output, kind=kind, along=along or ())
    write_file(out, lambda file: write_axes(ax, file))
    return Outcome("", {"figure": str(out)})


def _report(store: StudyStore) -> Outcome:
    counts, complaints, damaged = store.counts(), store.complaints(), store.damaged_chunks()
    failed = sum(number for number, *_ in complaints)
    lines = []
    if failed:
        lines.append(f"{failed} of {store.cases} cases failed; compute them again with --retry failed:")
        lines += [
            f"  {many} from case {first} on: {text} (on {where})" for many, first, text, where in complaints[:_MOST]
        ]
    if len(damaged):
        lines.append(f"damaged: {store.chunk_texts(damaged)}; compute it again with --resume")
    lines.append(f"{store.path}: {store.cases} cases")
    lines += [f"  {name.replace('_', ' '):<10} {count}" for name, count in counts.items() if count]
    data: dict[str, Any] = {
        "store": str(store.path),
        "cases": store.cases,
        "failed": failed,
        "counts": counts,
        "damaged_chunks": damaged.tolist(),
        "study_hash": store.attributes["study_hash"],
        "complaints": [
            {"cases": many, "first": first, "text": text, "processor": where}
            for many, first, text, where in complaints[:_MOST]
        ],
        "errors": [{"case": index, "name": name, "text": text} for index, name, text in store.errors()],
    }
    return Outcome("\n".join(lines), data)
