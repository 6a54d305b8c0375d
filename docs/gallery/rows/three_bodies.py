import casadi as ca

import shapephase as sp

r, limits = ca.SX.sym("r", 2), {"y": (0.3, 3.0)}
corners = ca.Function("corners", [r], [ca.vertcat(ca.DM([[-1.0, 0.0], [1.0, 0.0]]), r.T)])
three = sp.particle_body([1.0, 1.0, 1.0], corners, ["x", "y"], limits=limits)
plan = sp.plan_reorientation(three, sp.so3.exp([0.0, 0.0, 0.4]), start=[0.0, 1.2], rates_at_ends="free")
ax, times = sp.plots.column_axes(0.9), [k / 6 for k in range(7)]
for k, (shape, turn) in enumerate(zip(plan.path.shape(times), plan.motion.attitude(times))):
    ax.fill(*(three.positions(shape) @ turn.T + [2.4 * k, 0.0, 0.0])[:, :2].T, alpha=0.5, edgecolor="k")
ax.axis("scaled"), ax.set_axis_off()
