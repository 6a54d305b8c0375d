import shapephase as sp

top = sp.EulerTop.principal([2.0, 2.0, 0.8], [0.3, 0.5, 0.8])
ax = sp.plots.column_axes(3.6)
sp.plots.plot_cones(ax, top)
