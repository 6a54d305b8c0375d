import shapephase as sp

cat, path = sp.load_body("cat"), sp.examples.cat_righting()
joints = ("waist_pitch", "waist_yaw", "neck_yaw")
ax = sp.plots.column_axes(5.2, projection="3d")
sp.plots.plot_loop(ax, cat, path, joints)
