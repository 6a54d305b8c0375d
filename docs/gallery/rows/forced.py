import numpy as np

import shapephase as sp

gm, start, t = 3.986e14, [0.0, 0.4, 2.0], np.linspace(0.0, 600.0, 301)
orbit = sp.bounds.KeplerOrbit.from_state([7.0e6, 0, 0], [0, 7546.05, 0], gm=gm)


def gravity(state):
    return sp.bounds.gravity_gradient_torque(state.inertia, state.attitude.T @ orbit.position(state.time), gm)


body = sp.rigid(np.diag([80.0, 110.0, 150.0]), 600.0)
forced, ax = sp.reconstruct(body, start, torque=gravity), sp.plots.column_axes(2.6)
ax.legend(ax.plot(t, forced.momentum(t) - start), "xyz", ncols=3, loc=(0, 1.02))
ax.set(xlabel="$t$ [s]", ylabel="momentum gained [kg m²/s]")
