import numpy as np
from scipy.optimize import brentq

import shapephase as sp

pentagon, angles, row = sp.examples.linked_pentagon(), np.linspace(0, 2 * np.pi, 61), np.linspace(-3.2, 3.2, 65)
rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
sizes = [brentq(lambda size, ray=ray: sp.curvature(pentagon, size * ray)[0, 1, 2], 1.0, 2.5) for ray in rays]
loop = sp.ShapePath.spline(angles, np.array(sizes)[:, None] * rays)
ax = sp.plots.plot_curvature(sp.plots.column_axes(2.9), pentagon, ("a", "b"), row, row, path=loop)
for shape, turn in zip(loop.shape(angles[:-1:6]), sp.horizontal_lift(pentagon, loop).attitude(angles[:-1:6])):
    ax.set_aspect(1), ax.fill(*(0.45 * pentagon.positions(shape) @ turn.T + [*1.45 * shape, 0.0])[:, :2].T, "w", ec="k")
