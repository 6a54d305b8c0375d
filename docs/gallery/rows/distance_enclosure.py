import numpy as np

import shapephase as sp
from shapephase.rigid_body import geodesics as geo

metric, times = geo.left_invariant_metric([1.0, 2.0, 3.0]), np.linspace(0.2, 7.6, 38)
start, ax = metric.unit_speed([0.5, 0.6, 1.6]), sp.plots.column_axes(2.8)
found = [geo.distance_enclosure(metric, end, width=0.01) for end in metric.attitude(start, times)]
ax.fill_between(times, [d.lower for d in found], [d.upper for d in found], ec="#0072B2", label="distance, to 1 %")
ax.axvline(geo.cut_time_enclosure(metric, start, width=0.01).upper, color="#D55E00", label="cut time, to 1 %")
ax.axhline(geo.diameter_enclosure(metric).upper, color="#009E73", label="diameter, to 2 %")
ax.legend(loc=(0, 1.02)), ax.set(xlabel="length [√kg m]", ylabel="distance [√kg m]", ylim=(0, 6))
