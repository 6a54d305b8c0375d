// A page with one motion.
"use strict";

unpackedData().then(data => {
  window.page = playMotion(data.motion);
  page.clock.play(true);
});
