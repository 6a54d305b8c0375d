import shapephase as sp

cat, path = sp.load_body("cat"), sp.examples.cat_righting()
ax = sp.plots.column_axes(2.8)
sp.plots.plot_shape_path(ax, path, cat)
