"""Momentum of links as a table for people and as plain data for programs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..display import number_with_bar

if TYPE_CHECKING:
    from .momentum import FlightMomentum, SegmentMomentum


def momentum_lines(found: SegmentMomentum) -> list[str]:
    """Lines about the whole in each flight, and the mean and the largest size of each link's part."""
    unit = "no unit" if found.unit == "1" else found.unit
    axes = "the given axis" if len(found.axes) == 1 else ", ".join(found.axes)
    lines = [f"angular momentum about the centre of mass, {unit}, along {axes}"]
    if found.normalisation is not None:
        lines.append(_normalisation_text(found))
    if not found.flights:
        lines.append("no flight found: the centre of mass falls freely nowhere, or places are not recorded")
    for number, flight in enumerate(found.flights, start=1):
        lines += [
            "",
            f"flight {number}, {flight.first_time:.6g} to {flight.last_time:.6g} s: mean ({mean_text(flight)})",
            f"  {conservation_text(flight)}",
        ]
    rows = link_rows(found)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    table = []
    for name, *cells in rows:
        aligned = (cell.rjust(width) for cell, width in zip(cells, widths[1:], strict=True))
        table.append("  ".join([name.ljust(widths[0]), *aligned]).rstrip())
    return [*lines, "", *table, "", bars_text(found)]


def bars_text(found: SegmentMomentum) -> str:
    """Return what the columns of the table are and where its bars come from."""
    by = "numerical error" if not found.as_recorded else "noise of the samples, one standard deviation"
    oblique = "; sizes: of the largest component, as these axes are oblique" if "somersault" in found.axes else ""
    return f"local and remote: rms; ±: {by}{oblique}"


def link_rows(found: SegmentMomentum) -> list[tuple[str, ...]]:
    """Return the table of links: its heads, the mean and the largest size of each link's part, the whole."""
    names = ["mean " + axis for axis in found.axes]
    rows: list[tuple[str, ...]] = [("link", *names, "largest", "± (rms)", "local", "remote")]
    for k, link in enumerate(found.links):
        means = [f"{value:.4g}" for value in found.by_link[:, k].mean(axis=0)]
        parts = [_rms(found, values[:, k]) for values in (found.bars, found.local, found.remote)]
        rows.append(
            (link, *means, f"{_sizes(found, found.by_link[:, k]).max():.4g}", *(f"{value:.2g}" for value in parts))
        )
    whole = [f"{value:.4g}" for value in found.whole.mean(axis=0)]
    largest = _sizes(found, found.whole).max()
    rows.append(("whole", *whole, f"{largest:.4g}", f"{_rms(found, found.whole_bars):.2g}", "", ""))
    return rows


def mean_text(flight: FlightMomentum) -> str:
    """Return the mean along the chosen axes, with bars."""
    return ", ".join(number_with_bar(*pair) for pair in zip(flight.mean, flight.mean_bar, strict=True))


def conservation_text(flight: FlightMomentum) -> str:
    """How far a flight conserves the momentum, in words."""
    if flight.percent is None or flight.percent_bar is None:
        return "no momentum at any time"
    share = number_with_bar(flight.percent, flight.percent_bar)
    of = "of the mean" if flight.relative_to == "mean" else "of what the links carry, as the mean is within its noise"
    verdict = "more than noise: something else acts, or masses are wrong" if flight.more_than_noise else "within noise"
    return f"changes by {share} % {of}: {verdict}"


def momentum_data(found: SegmentMomentum) -> dict[str, Any]:
    """Flights, links and the normalisation, ready for JSON."""
    data: dict[str, Any] = {
        "unit": found.unit,
        "axes": list(found.axes),
        "as_recorded": found.as_recorded,
        "flights": [
            {
                "first_time_s": flight.first_time,
                "last_time_s": flight.last_time,
                "mean": flight.mean.tolist(),
                "mean_bar": flight.mean_bar.tolist(),
                "change": flight.change.tolist(),
                "change_bar": flight.change_bar.tolist(),
                "change_percent": flight.percent,
                "change_percent_bar": flight.percent_bar,
                "change_relative_to": flight.relative_to,
                "more_than_noise": flight.more_than_noise,
            }
            for flight in found.flights
        ],
        "links": {
            link: {
                "mean": found.by_link[:, k].mean(axis=0).tolist(),
                "largest": float(_sizes(found, found.by_link[:, k]).max()),
                "bar_rms": _rms(found, found.bars[:, k]),
                "local_rms": _rms(found, found.local[:, k]),
                "remote_rms": _rms(found, found.remote[:, k]),
            }
            for k, link in enumerate(found.links)
        },
    }
    data["whole"] = {
        "mean": found.whole.mean(axis=0).tolist(),
        "largest": float(_sizes(found, found.whole).max()),
        "bar_rms": _rms(found, found.whole_bars),
    }
    if found.normalisation is not None:
        data["normalisation"] = {name: value for name, value in vars(found.normalisation).items() if value is not None}
    return data


def _sizes(found: SegmentMomentum, vectors: Any) -> Any:
    """Sizes of vectors (N, C); along an athlete's axes, which are oblique, the largest component."""
    return np.linalg.norm(vectors, ord=np.inf if "somersault" in found.axes else 2, axis=1)


def _rms(found: SegmentMomentum, vectors: Any) -> float:
    """Root mean square of sizes of vectors (N, C)."""
    return float(np.sqrt((_sizes(found, vectors) ** 2).mean()))


def _normalisation_text(found: SegmentMomentum) -> str:
    by = found.normalisation
    assert by is not None
    numbers = [f"m = {by.mass:.6g} kg", f"h = {by.stature:.4g} m ({by.stature_by})"]
    numbers += [] if by.speed is None else [f"v = {by.speed:.4g} m/s"]
    numbers += [] if by.gravity is None else [f"g = {by.gravity:.4g} m/s^2"]
    return f"divided by {by.formula} = {by.divisor:.6g}: {', '.join(numbers)}"
