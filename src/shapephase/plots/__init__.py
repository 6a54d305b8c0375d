"""Figures (Matplotlib), pages in 3-D and reports in one file.

Functions `plot_...` draw into given Matplotlib axes and return them; `column_axes` makes axes one column wide. None of
them opens a window or keeps any state. Matplotlib is imported by the first drawing; without it they raise
MissingExtraError, for arguments that cannot be drawn ShapeError, WrongObjectError or UnknownNameError. `write_figure`
writes one of `FIGURES` to a file. `view`, `report`, `explore` and `rolling_ellipsoid` return a `Page` to write, show or
film.

    ax = sp.plots.plot_momentum_curve(sp.plots.column_axes(3.8), motion)
    ax.figure.savefig("curve.pdf")
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
