"""Vectors of three numbers in local variables, put where they are used."""

from __future__ import annotations

from .jit import inline


@inline
def plus(a, b):
    """The sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inline
def dot(a, b):
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def cross(a, b):
    """The vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
