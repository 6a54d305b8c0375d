// The motion, and beside it what it would be with a group held, by one clock and one camera.
"use strict";

unpackedData().then(data => {
  if (!data.held) {
    if (data.motion) window.page = playMotion(data.motion);
    return;
  }
  const clock = new Clock(data.motion.duration, data.motion.frames, data.motion.speed);
  const scenes = ["scene", "beside"].map(name => new Scene3D(document.getElementById(name)));
  const figures = [new Figure3D(scenes[0], data.motion), null];
  scenes[1].camera = scenes[0].camera;
  // A motion that ends earlier rests at its end.
  const placeIn = ({duration, frames}) => new Clock(duration, frames, 1).placeAt(clock.time);
  const show = () => figures.forEach(figure => figure.show(placeIn(figure.data)));
  const fit = () => scenes.forEach(scene => scene.fit(figures.flatMap(figure => figure.extent())));
  const hold = name => {
    Object.assign(scenes[1], {solids: [], drawOver: []});
    figures[1] = new Figure3D(scenes[1], data.held[name]);
    clock.duration = Math.max(data.motion.duration, data.held[name].duration);
    show();
    fit();
  };
  const chosen = document.getElementById("held");
  chosen.addEventListener("change", () => { hold(chosen.value); document.querySelector(".scrub").max = clock.duration; clock.changed(); });
  hold(chosen.value);
  for (const scene of scenes) {
    for (const kind of ["pointermove", "wheel", "keydown"]) {
      scene.holder.addEventListener(kind, () => scenes.forEach(other => other.invalidate()));
    }
  }
  const controls = document.getElementById("show");
  for (const [name, [azimuth, elevation]] of Object.entries(VIEWS)) {
    controls.append(element("button", {textContent: name, title: "from where", onclick: () => {
      Object.assign(scenes[0].camera, {azimuth, elevation});
      fit();
    }}));
  }
  [scenes[0].camera.azimuth, scenes[0].camera.elevation] = VIEWS.oblique;
  fit();
  clock.onChange(show);
  clockBar(document.getElementById("bar"), clock);
  window.page = {clock, scenes, figures};
});
