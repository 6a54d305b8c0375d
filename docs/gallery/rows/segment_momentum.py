import shapephase as sp

cat, path = sp.load_body("cat"), sp.examples.cat_righting()
motion = sp.reconstruct(sp.articulated(cat, path), [0.0, 0.0, 0.0])
ax = sp.plots.column_axes(3.4)
sp.plots.plot_segment_momentum(ax, sp.segment_momentum(motion), "z")
