import shapephase as sp

cat = sp.load_body("cat")
path = sp.read_shape_path("robots/cat_righting.csv", cat)
motion = sp.reconstruct(sp.articulated(cat, path), [0.01, 0.0, 0.02])
phases, bars = sp.split(motion), sp.uncertainty(motion, joints="1deg")
ax = sp.plots.column_axes(2.0)
for name in ("dynamic_phase", "montgomery_phase"):
    ax.errorbar(getattr(phases, name), name, xerr=getattr(bars, name), fmt="o", capsize=5)
ax.set(xlabel="[rad]", ylim=(-0.5, 1.5))
