import shapephase as sp

ax = sp.plots.column_axes(2.8)
sp.plots.plot_potential(ax, [3.0, 2.0, 1.0])
