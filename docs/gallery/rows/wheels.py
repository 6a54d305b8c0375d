import numpy as np

import shapephase as sp

satellite, t = sp.load_body("satellite"), np.linspace(0.0, 60.0, 401)
rest = [name for name in satellite.joint_names if name != "wheel_spin"]
still = sp.ShapePath.waypoints([0, 60], np.zeros((2, len(rest))), joint_names=rest)
coasting = sp.articulated(satellite, still, rotors={"wheel_spin": 2.0})
motion = sp.reconstruct(coasting, [30.0, 0.0, 20.0])
ax = sp.plots.column_axes(2.6)
ax.plot(t, sp.dynamics.wheel_speeds(motion, t)[:, 0])
ax.set(xlabel="$t$ [s]", ylabel="wheel [rad/s]")
