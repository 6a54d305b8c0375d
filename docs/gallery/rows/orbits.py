import shapephase as sp

satellite = sp.load_body("satellite")
sweep = sp.examples.MOTIONS["satellite_sweep"].path()
moving = sp.articulated(satellite, sweep)
points = sp.fixed_points(moving, 3.0)
ax = sp.plots.column_axes(3.9)
sp.plots.plot_fixed_points(ax, points, inertia=moving.inertia(0.0))
