import shapephase as sp

tops = [[1.5, 1.2], [2.5, 1.2], [3.2, 0.4]]
ax = sp.plots.column_axes(3.0)
sp.plots.plot_heavy_top_stability(ax, tops)
