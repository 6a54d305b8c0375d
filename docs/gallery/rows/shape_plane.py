import shapephase as sp

cat, path = sp.load_body("cat"), sp.examples.cat_righting()
joints = ("waist_pitch", "waist_yaw")
ax = sp.plots.column_axes(3.0)
sp.plots.plot_shape_plane(ax, path, joints, cat)
