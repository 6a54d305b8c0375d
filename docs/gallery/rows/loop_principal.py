import shapephase as sp

cat = sp.load_body("cat_two_halves")
loop = sp.examples.kane_scher(0.0, 1.037)
ax = sp.plots.column_axes(5.2)
sp.plots.plot_loop(ax, cat, loop, "principal", axis="norm")
