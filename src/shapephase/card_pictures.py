"""Small pictures of cards, as SVG that takes the colour of the text around it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from .arrays import Array

_WIDTH, _HEIGHT, _MARGIN = 200.0, 90.0, 6.0  # pixels
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")  # of Okabe and Ito
_DASHES = ("", "6 3", "6 2 1 2", "2 2", "9 4", "1 2")  # for print in black and white
_MOST_CURVES = len(_COLOURS)
MOST_POINTS = 80  # of a curve


def curves_picture(values: Array, about: str) -> str:
    """Return a picture of curves in time (N, k), those that move most."""
    chosen = np.argsort(-np.ptp(values, axis=0), kind="stable")[:_MOST_CURVES]
    rows = values[:, np.sort(chosen)]
    low, high = (float(rows.min()), float(rows.max())) if rows.size else (0.0, 0.0)
    if high - low <= 1e-12 * max(abs(low), abs(high), 1e-300):
        low, high = low - 1.0, high + 1.0
    x = np.linspace(_MARGIN, _WIDTH - _MARGIN, len(rows))
    y = _HEIGHT - _MARGIN - (rows - low) / (high - low) * (_HEIGHT - 2.0 * _MARGIN)
    lines = [_line(zip(x, column), number) for number, column in enumerate(y.T)]
    if low < 0.0 < high:
        zero = _HEIGHT - _MARGIN + low / (high - low) * (_HEIGHT - 2.0 * _MARGIN)
        lines.insert(0, _thin((_MARGIN, zero), (_WIDTH - _MARGIN, zero)))
    return _picture(lines, _WIDTH, _HEIGHT, about)


def bars_picture(values: Sequence[float], about: str) -> str:
    """Return a picture of bars to both sides of zero."""
    low, high = min(0.0, *values), max(0.0, *values)
    scale = (_WIDTH - 2.0 * _MARGIN) / (high - low if high > low else 1.0)
    thick = (_HEIGHT - 2.0 * _MARGIN) / len(values)
    zero = _MARGIN - low * scale
    bars = [
        f'<rect x="{min(zero, zero + value * scale):.1f}" y="{_MARGIN + number * thick + 0.15 * thick:.1f}" '
        f'width="{abs(value) * scale:.1f}" height="{0.7 * thick:.1f}" fill="{_COLOURS[number % _MOST_CURVES]}"/>'
        for number, value in enumerate(values)
    ]
    return _picture([*bars, _thin((zero, 0.0), (zero, _HEIGHT))], _WIDTH, _HEIGHT, about)


def sphere_picture(points: Array, kinds: Sequence[int], about: str) -> str:
    """Return a picture of directions (N, 3) on the unit sphere; those behind are hollow, `kinds` choose colours."""
    eye, screen = _side_view()
    middle, radius = 0.5 * _HEIGHT, 0.5 * _HEIGHT - _MARGIN
    dots = [
        f'<circle cx="{middle}" cy="{middle}" r="{radius}" fill="none" stroke="currentColor" stroke-opacity="0.4"/>'
    ]
    for point, kind in zip(points, kinds, strict=True):
        x, y = middle + radius * screen @ point * (1.0, -1.0)
        colour = _COLOURS[kind % _MOST_CURVES]
        fill = colour if point @ eye >= 0.0 else "none"
        dots.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{fill}" stroke="{colour}"/>')
    return _picture(dots, _HEIGHT, _HEIGHT, about)


def sticks_picture(starts: Array, ends: Array, about: str) -> str:
    """Return a picture of sticks between points of space: (N, 3), (N, 3) [m]."""
    _, screen = _side_view()
    points = np.stack([starts, ends]) @ screen.T * (1.0, -1.0)
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    scale = (_HEIGHT - 2.0 * _MARGIN) / max(float(np.max(high - low)), 1e-300)
    shift = 0.5 * _HEIGHT - 0.5 * scale * (low + high)
    flat = points * scale + shift
    sticks = [
        f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" stroke="currentColor" '
        'stroke-width="2" stroke-linecap="round"/>'
        for a, b in zip(flat[0], flat[1])
    ]
    return _picture(sticks, _HEIGHT, _HEIGHT, about)


def _side_view() -> tuple[Array, Array]:
    """Direction to the eye, and axes to the right and up: (3,), (2, 3)."""
    rise, turn = np.radians([20.0, 35.0])
    eye = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    return eye, np.stack([right, np.cross(eye, right)])


def _line(points: Iterable[tuple[float, float]], number: int) -> str:
    places = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dashes = f' stroke-dasharray="{_DASHES[number]}"' if _DASHES[number] else ""
    return f'<polyline points="{places}" fill="none" stroke="{_COLOURS[number]}" stroke-width="1.5"{dashes}/>'


def _thin(start: tuple[float, float], end: tuple[float, float]) -> str:
    return (
        f'<line x1="{start[0]:.1f}" y1="{start[1]:.1f}" x2="{end[0]:.1f}" y2="{end[1]:.1f}" stroke="currentColor" '
        'stroke-opacity="0.4"/>'
    )


def _picture(parts: list[str], width: float, height: float, about: str) -> str:
    size = f'width="{width:g}" height="{height:g}" viewBox="0 0 {width:g} {height:g}"'
    return f'<svg role="img" aria-label="{about}" {size} xmlns="http://www.w3.org/2000/svg">{"".join(parts)}</svg>'
