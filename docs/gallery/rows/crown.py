import shapephase as sp

antenna = sp.examples.printed_antenna(3)
motion = sp.reconstruct(antenna.deformation, antenna.momentum)
crown = sp.bounds.crown_region(antenna.deformation, antenna.momentum)
ax = sp.plots.column_axes(3.9)
sp.plots.plot_crown(ax, crown, motion)
