import shapephase as sp

oblate = sp.rigid_body.geodesics.ellipsoid(0.6)
ax = sp.plots.column_axes(3.0)
sp.plots.plot_surface_locus(ax, oblate, orders=(1, 2))
