import shapephase as sp

satellite = sp.load_body("satellite")
sweep = sp.examples.MOTIONS["satellite_sweep"].path()
drift = sp.reconstruct(sp.articulated(satellite, sweep), [0.0, 0.0, 0.0])
moved = [name for name in satellite.joint_names if name != "wheel_spin"]
way = sp.optimal_control.undo(drift, joints=moved)
ax = sp.plots.column_axes(3.0)
sp.plots.plot_shape_path(ax, way.plan.path, satellite)
