// A report: the motion, and beside it curves and the momentum's sphere, all at the time of one clock.
"use strict";

unpackedData().then(data => {
  window.page = playMotion(data.motion);
  const sphere = document.getElementById("sphere");
  if (sphere) page.sphere = new MomentumSphere(sphere, data.directions, page.clock);
  page.plots = data.plots.map(plot => new TimePlot(document.getElementById("plots"), plot, page.clock));
  page.clock.changed();
});
