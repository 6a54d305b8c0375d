import shapephase as sp

satellite = sp.load_body("satellite")
sweep = sp.examples.MOTIONS["satellite_sweep"].path()
joints = ("arm_1", "boom_extension")
ax = sp.plots.column_axes(2.8)
sp.plots.plot_curvature(ax, satellite, joints, path=sweep)
