"""Results as figures (Matplotlib), as a page in 3-D and as a report in one file.

`plots` has every figure: functions that draw into given axes. `write_figure` writes one of `FIGURES` to a file, `view`
and `motion_page` show a motion in 3-D, `write_report` puts all of it into one page.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
