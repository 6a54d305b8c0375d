import numpy as np

import shapephase as sp

over = {
    "momentum_z": np.linspace(0.0, 0.2, 9),
    "masses": sp.study.LogNormal(0.05),
}
cats = sp.study.Study("cat", "cat_righting", over, outputs=("turn",), draws=20)
store = cats.run("out.zarr")
ax = sp.plots.column_axes(2.8)
sp.study.plot_study(ax, store, "turn")
