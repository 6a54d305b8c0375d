// The bar below a scene: play, frame by frame, scrub, speed; and what is shown of the scene, from where.
"use strict";

function element(kind, attributes = {}, ...children) {
  const made = document.createElement(kind);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name in made) made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

// A number as text for people, with a minus as long as a plus.
function typeset(number) {
  return String(number).replaceAll("-", "−");
}

function shortNumber(value) {
  return typeset(Number(value.toPrecision(3)));
}

// The bar of a clock, in a holder.
function clockBar(holder, clock) {
  const play = element("button", {className: "play", title: "play or stop (space)", onclick: () => clock.play()});
  const back = element("button", {title: "a frame back (left)", textContent: "◂", onclick: () => clock.step(-1)});
  const on = element("button", {title: "a frame on (right)", textContent: "▸", onclick: () => clock.step(1)});
  const scrub = element("input", {
    type: "range", min: 0, max: clock.duration, step: "any", className: "scrub", title: "time",
    oninput: event => { clock.playing = false; clock.show(Number(event.target.value)); },
  });
  scrub.setAttribute("aria-label", "time in seconds");
  const time = element("output", {className: "time"});
  const speed = element("select", {title: "seconds of the body in a second of playing",
    onchange: event => { clock.speed = Number(event.target.value); clock.changed(); }});
  const rates = new Set([0.05, 0.1, 0.25, 0.5, 1, 2, 4, clock.speed]);
  for (const rate of [...rates].sort((a, b) => a - b)) {
    speed.append(element("option", {value: rate, textContent: `× ${shortNumber(rate)}`, selected: rate === clock.speed}));
  }
  holder.append(play, back, on, scrub, time, speed);
  clock.onChange(() => {
    play.textContent = clock.playing ? "❚❚" : "►";
    scrub.value = clock.time;
    time.textContent = `${clock.time.toFixed(3)} s`;
  });
  document.addEventListener("keydown", event => {
    if (event.target.closest("input, select, textarea")) return;
    if (event.key === " " && event.target.closest("button")) return;
    if (event.key === " ") clock.play();
    else if (event.key === "ArrowRight") clock.step(1);
    else if (event.key === "ArrowLeft") clock.step(-1);
    else return;
    event.preventDefault();
  });
}

// Where the camera stands, by name: azimuth and elevation [rad].
const VIEWS = {oblique: [-0.94, 0.37], front: [0, 0], side: [-Math.PI / 2, 0], top: [-Math.PI / 2, 1.57]};

function sceneControls(holder, scene, figure) {
  const look = name => {
    [scene.camera.azimuth, scene.camera.elevation] = VIEWS[name];
    scene.fit(figure.extent());
  };
  for (const name of Object.keys(VIEWS)) {
    holder.append(element("button", {textContent: name, title: "from where", onclick: () => look(name)}));
  }
  const frame = element("label", {title: "the camera turns with the base"},
    element("input", {type: "checkbox", onchange: event => {
      figure.bodyFrame = event.target.checked;
      figure.show(figure.place);
    }}), "body's frame");
  holder.append(frame);
  if (figure.travels) {
    holder.append(element("label", {title: "the camera goes with the centre of mass"},
      element("input", {type: "checkbox", checked: figure.follows, onchange: event => {
        figure.follows = event.target.checked;
        figure.show(figure.place);
        scene.fit(figure.extent());
      }}), "follow"));
  }
  const hues = {momentum: "#d55e00", ghost: "#9a9ea5", trail: "#0072b2", "inertial axes": "#737373",
    "base axes": "conic-gradient(#cc79a7 33%, #009e73 0 67%, #0072b2 0)", "centre of mass": "#1a1a1a", floor: "#c7c7c7", herpolhode: "#e69f00", polhode: "#0072b2",
    "angular velocity": "#009e73", "invariable plane": "#9ea3ab"};
  for (const group of figure.shownGroups()) {
    const hue = element("span", {className: "hue"});
    hue.style.background = hues[group];
    const name = group === "ghost" ? "start (ghost)" : group;
    holder.append(element("label", {title: "shown or not"}, element("input", {
      type: "checkbox", checked: true, onchange: event => figure.toggle(group, event.target.checked),
    }), hue, name));
  }
  look("oblique");
}

// A joint's coordinate for people.
function jointValue({unit}, value) {
  if (unit === "1") return typeset(value.toFixed(4));
  return typeset(unit === "rad" ? `${(value * 180 / Math.PI).toFixed(1)}°` : `${value.toFixed(4)} m`);
}

// Sliders of the joints: moved by hand, the body leaves its motion until it is let go.
function jointSliders(holder, figure, clock) {
  const joints = figure.data.joints;
  if (!joints?.length) return;
  const sliders = joints.map((joint, k) => {
    const value = element("output");
    const slider = element("input", {type: "range", min: joint.lower, max: joint.upper, step: "any"});
    slider.setAttribute("aria-label", joint.name);
    slider.addEventListener("input", () => {
      clock.playing = false;
      figure.byHand ??= figure.shapeAt(clock.place());
      figure.byHand[k] = Number(slider.value);
      release.disabled = false;
      clock.changed();
    });
    holder.append(element("label", {className: "joint"}, element("span", {textContent: joint.name, title: joint.name}), slider, value));
    return {slider, value, joint};
  });
  const release = element("button", {textContent: "back to the motion", disabled: true, onclick: () => {
    figure.byHand = null;
    release.disabled = true;
    clock.changed();
  }});
  holder.append(release);
  clock.onChange(() => {
    if (clock.playing && figure.byHand) { figure.byHand = null; release.disabled = true; figure.show(clock.place()); }
    const shape = figure.byHand ?? figure.shapeAt(clock.place());
    sliders.forEach(({slider, value, joint}, k) => {
      slider.value = shape[k];
      value.textContent = jointValue(joint, shape[k]);
    });
  });
}

// A motion in the page's elements `scene`, `bar`, `show` and, if there is one, `joints`; `add` adds to its figure.
function playMotion(data, add = () => {}) {
  const clock = new Clock(data.duration, data.frames, data.speed);
  const scene = new Scene3D(document.getElementById("scene"));
  const figure = new Figure3D(scene, data);
  add(figure);
  clock.onChange(() => figure.show(clock.place()));
  clockBar(document.getElementById("bar"), clock);
  sceneControls(document.getElementById("show"), scene, figure);
  const holder = document.getElementById("joints");
  if (holder) jointSliders(holder, figure, clock);
  return {clock, scene, figure, film: () => film(clock, scene, figure)};
}

// Nothing but the scene and the time, for films.
function film(clock, scene, figure) {
  clock.play(false);
  document.documentElement.className = "film";
  scene.drawOver.push(pen => {
    const {clientWidth, clientHeight} = scene.holder;
    label(pen, [clientWidth - 12, clientHeight - 16], `${clock.time.toFixed(2)} s`, "#333", "right");
  });
  clock.show(0);
  scene.fit(figure.extent());
}
