import shapephase as sp

top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.3, 0.5, 0.9])
ax = sp.plots.column_axes(3.6)
sp.plots.plot_rolling_ellipsoid(ax, top, time=1.0)
