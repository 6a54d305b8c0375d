import shapephase as sp

chart, attitude = sp.rigid_body.ZXZ, sp.so3.exp([0.8, -0.2, 1.2])
ax = sp.plots.column_axes(3.9)
sp.plots.plot_euler_angles(ax, chart.angles(attitude), chart)
