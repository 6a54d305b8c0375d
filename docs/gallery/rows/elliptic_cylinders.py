import shapephase as sp

top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
ax = sp.plots.column_axes(3.9)
sp.plots.plot_elliptic_cylinders(ax, top)
