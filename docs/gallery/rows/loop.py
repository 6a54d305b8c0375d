import shapephase as sp

cat, path = sp.load_body("cat"), sp.examples.cat_righting()
ax = sp.plots.column_axes(5.2)
sp.plots.plot_loop(ax, cat, path)
