import shapephase as sp

astronaut = sp.load_body("astronaut")
swing = sp.examples.MOTIONS["astronaut_leg_swing"].path()
motion = sp.reconstruct(sp.articulated(astronaut, swing), [0.5, 2.0, 3.0])
ax = sp.plots.column_axes(3.9)
sp.plots.plot_momentum_curve(ax, motion)
