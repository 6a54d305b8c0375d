// A page with one motion.
"use strict";

// Nothing but the moving body and the time, for films.
function film() {
  const {scene, figure, clock} = page;
  clock.play(false);
  document.documentElement.className = "film";
  scene.drawOver.push(pen => {
    const {clientWidth, clientHeight} = scene.holder;
    label(pen, [clientWidth - 12, clientHeight - 16], `${clock.time.toFixed(2)} s`, "#333", "right");
  });
  clock.show(0);
  scene.fit(figure.extent());
}

unpackedData().then(data => {
  window.page = {...playMotion(data.motion), film};
  page.clock.play(true);
});
