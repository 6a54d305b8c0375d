import shapephase as sp

ax = sp.plots.column_axes(3.6, projection="3d")
sp.plots.plot_caustic(ax, [2.0, 2.0, 1.0])
