import numpy as np

import shapephase as sp
from shapephase.rigid_body import geodesics

metric = geodesics.left_invariant_metric([1.0, 2.0, 3.0])
start = metric.unit_speed([0.5, 0.6, 1.6])
times = np.linspace(0.2, 7.6, 38)
ends = metric.attitude(start, times)
near = [geodesics.shortest_geodesic(metric, end) for end in ends]
exact = [geodesics.distance_enclosure(metric, end, width=0.01) for end in ends]
cut = geodesics.cut_time_enclosure(metric, start, width=0.01)

ax = sp.plots.column_axes(2.8)
lower, upper = [d.lower_bound for d in near], [d.upper_bound for d in near]
ax.fill_between(times, lower, upper, color="#56B4E9", alpha=0.4, label="axisymmetric bounds")
lower, upper = [d.lower for d in exact], [d.upper for d in exact]
ax.fill_between(times, lower, upper, color="#0072B2", linewidth=1.2, label="distance, to 1 %")
ax.plot(times, times, "--", color="0.5", label="along the geodesic")
ax.axvspan(cut.lower, cut.upper, color="#D55E00", linewidth=0, label="cut time")
ax.axhline(geodesics.diameter_enclosure(metric).upper, color="#009E73", label="diameter")
ax.set(xlabel="time", ylabel="distance", xlim=(0.0, 7.6), ylim=(0.0, 6.0))
ax.legend(fontsize="x-small", loc="lower right")
