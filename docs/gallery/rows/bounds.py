import shapephase as sp

diver = sp.load_body("diver")
twist = sp.examples.MOTIONS["diver_twist"].path()
motion = sp.reconstruct(sp.articulated(diver, twist), [0.0, 61.56, 0.0])
ax = sp.plots.column_axes(4.0)
sp.plots.plot_bounds(ax, sp.bounds.bounds(motion))
