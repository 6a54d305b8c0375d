// A page to draw a loop of two joints on: its turn, the body along it, and the loop as a file.
"use strict";

// The name of a loop that was drawn or opened, among those of the shapes; the height of a line of text [px].
const OWN = "drawn";
const LINE = 20;

// A rotation vector as angle and axis, with so many digits each.
function turnText(vector, digits, axisDigits) {
  const angle = norm(vector);
  const rounded = value => (Math.round(value * 10 ** axisDigits) / 10 ** axisDigits + 0).toFixed(axisDigits);
  const axis = angle < 1e-12 ? "" : ` about (${times(vector, 1 / angle).map(rounded).join(", ")})`;
  return typeset(`${(angle * 180 / Math.PI).toFixed(digits)}°${axis}`);
}

class Explorer {
  constructor(data) {
    this.plane = data.plane;
    Object.assign(this, playMotion(data.motion));
    this.inertia = new PlaneInertia(this.plane);
    this.map = new CurvatureMap(document.getElementById("map"), this.plane);
    this.map.listeners.push(points => this.take(handLoop(points, this.plane.shown.map(([a, b]) => b - a)), "drawn"));
    this.mapControls();
    this.loopControls();
    this.momentumControls();
    this.clock.onChange(() => this.mark());
    this.make();
  }

  // A labelled slider with its value, in a holder.
  slider(holder, name, {low, high, value, step = "any"}, text, moved) {
    const shown = element("output");
    const input = element("input", {type: "range", min: low, max: high, step, value, oninput: () => moved()});
    input.setAttribute("aria-label", name);
    holder.append(element("label", {className: "slider"}, element("span", {textContent: name, title: name}), input, shown));
    this.sliders ??= [];
    this.sliders.push(() => { shown.textContent = text(Number(input.value)); });
    return input;
  }

  // Sliders of a named loop.
  loopControls() {
    const holder = document.getElementById("make"), {shown, joints} = this.plane;
    this.shape = element("select", {onchange: () => this.make()});
    this.shape.setAttribute("aria-label", "shape of the loop");
    for (const name of [...Object.keys(SHAPES), OWN]) this.shape.append(element("option", {textContent: name, disabled: name === OWN}));
    holder.append(element("label", {}, "loop ", this.shape));
    const slider = (name, ends, text) => this.slider(holder, name, ends, text, () => this.make());
    this.centre = shown.map(([low, high], n) => slider(`middle ${joints[n].name}`, {low, high, value: 0.5 * (low + high)},
      value => jointValue(joints[n], value)));
    this.half = shown.map(([low, high], n) => slider(`size ${joints[n].name}`,
      {low: 0.01 * (high - low), high: 0.5 * (high - low), value: 0.25 * (high - low)}, value => jointValue(joints[n], value)));
    this.angle = slider("turned", {low: -180, high: 180, value: 0, step: 1}, value => typeset(`${value}°`));
    const button = (textContent, onclick, id = "") => element("button", {textContent, onclick, id});
    const reverse = button("other way round", () => { this.reversed = !this.reversed; this.make(); });
    const file = element("input", {type: "file", accept: ".csv", onchange: async () => this.open(await file.files[0].text())});
    file.setAttribute("aria-label", "CSV file with a loop");
    holder.append(element("span", {className: "buttons"}, reverse, button("save as CSV", () => this.save("csv"), "save"),
      button("save as PNG", () => this.save("png")), button("save as SVG", () => this.save("svg"))),
      element("label", {className: "file"}, "the loop of a file ", file));
  }

  open(text) {
    try {
      this.take(loopOfFile(text, this.plane.joints), "file");
    } catch (error) {
      document.getElementById("parts").textContent = error.message;
    }
  }

  // Sliders of the angular momentum in inertial axes, those of the base at the start.
  momentumControls() {
    const holder = document.getElementById("momentum"), end = this.plane.largest_momentum;
    const again = () => this.follow(this.points, this.kind);
    this.components = ["X", "Y", "Z"].map(letter => this.slider(holder, `momentum ${letter}`,
      {low: -end, high: end, value: 0, step: end / 50}, value => `${shortNumber(value)} kg m²/s`, again));
    holder.append(element("span", {className: "buttons"}, element("button", {textContent: "no momentum", onclick: () => {
      for (const input of this.components) input.value = 0;
      again();
    }})));
  }

  // Of the sliders, whose steps round.
  chosenMomentum() {
    return this.components.map(input => Number(Number(input.value).toPrecision(6)))
      .map(value => Math.abs(value) < 1e-6 * this.plane.largest_momentum ? 0 : value);
  }

  // What the map shows.
  mapControls() {
    const shows = document.getElementById("shows");
    for (const [name, choices, key] of [
      ["curvature", ["largest", "x", "y", "z", "magnitude"], "component"],
      ["seen in", Object.keys(this.plane.curvature), "gauge"],
    ]) {
      const select = element("select", {onchange: () => { this.map[key] = select.value; this.map.colour(); this.explain(); }});
      for (const choice of choices) {
        select.append(element("option", {value: choice, textContent: choice === "largest" ? "largest component" : choice,
          selected: this.map[key] === choice}));
      }
      shows.append(element("label", {}, `${name} `, select));
    }
    this.explain();
  }

  explain() {
    const {component, gauge, axis, largest} = this.map;
    const what = component === "magnitude" ? "magnitude" : `component ${axis}`;
    const frame = gauge === "base axes" ? "base axes" : "the axes that the connection turns least";
    const {negative, positive} = this.plane.colours;
    document.body.style.setProperty("--negative", negative);
    document.body.style.setProperty("--positive", positive);
    const unsigned = component === "magnitude", [one, other] = this.plane.joints.map(joint => joint.unit);
    const per = one === other ? `${one}²` : `(${one} ${other})`;
    document.getElementById("colours").className = unsigned ? "unsigned" : "";
    const ends = unsigned ? [0, 0.5 * largest, largest] : [-largest, 0, largest];
    document.getElementById("ends").replaceChildren(...ends.map(value => element("span", {textContent: shortNumber(value * 180 / Math.PI)})));
    this.shows = `Curvature, ${what} in ${frame}, in deg/${per}.`;
    document.getElementById("scale").textContent =
      `${this.shows} A small loop, ` +
      "counter-clockwise, turns the body by minus the curvature times its area.";
  }

  make() {
    const limits = this.plane.shown, own = this.shape.value === OWN;
    const centre = this.centre.map(input => Number(input.value)), half = this.half.map(input => Number(input.value));
    const points = placedLoop(own ? this.own : unitLoop(this.shape.value), centre, half, Number(this.angle.value) * Math.PI / 180)
      .map(p => p.map((value, n) => Math.min(limits[n][1], Math.max(limits[n][0], value))));
    this.follow(this.reversed ? [points[0], ...points.slice(1).reverse()] : points, own ? this.kind : this.shape.value);
  }

  // A loop that was drawn or opened, which the sliders then move.
  take(points, kind) {
    const {centre, half} = extentOf(points);
    this.own = points.map(p => p.map((value, n) => (value - centre[n]) / half[n]));
    this.reversed = false;
    this.angle.value = 0;
    [this.centre, this.half].forEach((inputs, k) => inputs.forEach((input, n) => { input.value = [centre, half][k][n]; }));
    for (const choice of this.shape.options) if (choice.value === OWN) choice.disabled = false;
    this.shape.value = OWN;
    this.follow(points, kind);
  }

  // A loop to go round.
  follow(points, kind) {
    Object.assign(this, {points, kind, spline: new PeriodicSpline(points), momentum: this.chosenMomentum()});
    // The time from one point to the next is the unit of the spline.
    const scaledMomentum = times(this.momentum, this.clock.duration / points.length);
    this.result = turnRound(this.inertia, this.spline, scaledMomentum, this.plane);
    this.byShape = norm(this.momentum) ? turnRound(this.inertia, this.spline, [0, 0, 0], this.plane) : this.result;
    this.flux = fluxThrough(this.inertia, this.spline);
    this.map.spline = this.spline;
    this.figure.pointAlong(this.momentum);
    for (const show of this.sliders) show();
    this.fly();
    this.say();
    this.clock.changed();
  }

  // The body along the loop, with its centre of mass at rest.
  fly() {
    const {data} = this.figure, count = data.frames, width = data.joints.length, {attitudes} = this.result;
    for (let k = 0; k < count; k++) {
      const time = this.spline.count * k / (count - 1), place = time * STEPS[1];
      const before = Math.min(Math.floor(place), attitudes.length - 2);
      const turn = slerp(attitudes[before], attitudes[before + 1], place - before);
      const shape = Array.from(this.plane.rest);
      this.spline.at(time).place.forEach((value, n) => { shape[this.plane.joints[n].place] = value; });
      const centre = centreOfMass(data.chain, framePoses(data.chain, shape));
      data.shapes.set(shape, k * width);
      data.turns.set(turn, 4 * k);
      data.places.set(times(turned(poseOfQuaternion(turn, [0, 0, 0]), centre), -1), 3 * k);
    }
    this.figure.placeGhosts();
  }

  say() {
    const {vector, attitudes, bySteps, bySeries, inside} = this.result, put = (id, text) => {
      document.getElementById(id).textContent = text;
    };
    put("turn", turnText(vector, 5, 4));
    put("radians", `${norm(vector).toFixed(9)} rad`);
    put("flux", `Flux of the curvature through the loop: ${turnText(this.flux, 2, 2)}, base axes. The order of the turns adds ` +
      `${turnText(plus(this.byShape.vector, this.flux, -1), 2, 2)}.`);
    const error = value => typeset(value.toExponential(1));
    put("error", inside
      ? `± ${error(bySteps + bySeries)} rad: series ${error(bySeries)}, steps ${error(bySteps)}`
      : "The loop swings out of the map, where the page knows nothing: no certain number.");
    if (!norm(this.momentum)) {
      put("parts", "There is no angular momentum; the shape alone turns the body.");
      return;
    }
    const end = attitudes[attitudes.length - 1], shape = this.byShape.attitudes[attitudes.length - 1];
    const added = vectorOfQuaternion(quaternionProduct(end, [-shape[0], -shape[1], -shape[2], shape[3]]));
    put("parts", `In ${shortNumber(this.clock.duration)} s. The shape alone: ${turnText(this.byShape.vector, 2, 2)}. The momentum ` +
      `added ${turnText(added, 2, 2)}. As split says with --momentum ${this.momentum.join(" ")}`);
  }

  mark() {
    if (!this.spline) return;
    this.map.now = this.spline.at(this.spline.count * this.clock.time / this.clock.duration).place;
    this.map.draw();
  }

  // The loop as a file of `split`: its points with the first once more, which makes the spline periodic.
  csv() {
    const quoted = name => /[",;\s]/.test(name) ? `"${name.replaceAll('"', '""')}"` : name;
    const lines = [["time", ...this.plane.all_joints.map(quoted)].join(",")];
    [...this.points, this.points[0]].forEach((point, k) => {
      const shape = Array.from(this.plane.rest);
      point.forEach((value, n) => { shape[this.plane.joints[n].place] = value; });
      lines.push([this.clock.duration * k / this.points.length, ...shape].join(","));
    });
    return lines.join("\n") + "\n";
  }

  // The map with its loop as a picture, and below it what it shows.
  svg() {
    const {map} = this, width = map.canvas.clientWidth, height = map.canvas.clientHeight, pen = new SvgPen(width, height + 3 * LINE);
    map.paint(pen);
    const span = shortNumber(map.largest * 180 / Math.PI), turn = turnText(this.result.vector, 2, 2);
    const range = `From ${map.component === "magnitude" ? "0" : `−${span}`} (${map.component === "magnitude" ? "white" : "orange"}) to ${span} (blue).`;
    [this.shows, range, `One round turns the body by ${turn}.`]
      .forEach((text, k) => label(pen, [8, height + (k + 0.5) * LINE], text, "#333", "left"));
    return pen.svg();
  }

  async save(kind) {
    const blob = kind === "png" ? await rasterised(this.svg())
      : new Blob([kind === "csv" ? this.csv() : this.svg()], {type: kind === "csv" ? "text/csv" : "image/svg+xml"});
    const names = this.plane.joints.map(joint => joint.name.replace(/\W+/g, "_"));
    const address = URL.createObjectURL(blob);
    element("a", {href: address, download: `loop_${names.join("_")}.${kind}`}).click();
    setTimeout(() => URL.revokeObjectURL(address), 10000);
  }
}

// An SVG picture as PNG, at twice its size.
async function rasterised(svg) {
  const picture = new Image();
  picture.src = `data:image/svg+xml,${encodeURIComponent(svg)}`;
  await picture.decode();
  const canvas = Object.assign(document.createElement("canvas"), {width: 2 * picture.width, height: 2 * picture.height});
  canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
  return new Promise(done => canvas.toBlob(done, "image/png"));
}

unpackedData().then(data => { window.page = new Explorer(data); });
