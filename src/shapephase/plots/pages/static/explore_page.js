// A page to draw a loop of two joints on: its turn, the body along it, and the loop as a file.
"use strict";

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
    for (const name of Object.keys(SHAPES)) this.shape.append(element("option", {textContent: name}));
    holder.append(element("label", {}, "loop ", this.shape));
    const slider = (name, ends, text) => this.slider(holder, name, ends, text, () => this.make());
    this.centre = shown.map(([low, high], n) => slider(`middle ${joints[n].name}`, {low, high, value: 0.5 * (low + high)},
      value => jointValue(joints[n], value)));
    this.half = shown.map(([low, high], n) => slider(`size ${joints[n].name}`,
      {low: 0.01 * (high - low), high: 0.5 * (high - low), value: 0.25 * (high - low)}, value => jointValue(joints[n], value)));
    this.angle = slider("turned", {low: -180, high: 180, value: 0, step: 1}, value => typeset(`${value}°`));
    const reverse = element("button", {textContent: "other way round", onclick: () => {
      this.take([this.points[0], ...this.points.slice(1).reverse()], this.kind);
    }});
    const save = element("button", {id: "save", textContent: "save as CSV", onclick: () => this.save()});
    holder.append(element("span", {className: "buttons"}, reverse, save));
  }

  // Sliders of the angular momentum in inertial axes, those of the base at the start.
  momentumControls() {
    const holder = document.getElementById("momentum"), end = this.plane.largest_momentum;
    const again = () => this.take(this.points, this.kind);
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
    const unsigned = component === "magnitude", [one, other] = this.plane.joints.map(joint => joint.unit);
    const per = one === other ? `${one}²` : `(${one} ${other})`;
    document.getElementById("colours").className = unsigned ? "unsigned" : "";
    const ends = unsigned ? [0, 0.5 * largest, largest] : [-largest, 0, largest];
    document.getElementById("ends").replaceChildren(...ends.map(value => element("span", {textContent: shortNumber(value)})));
    document.getElementById("scale").textContent =
      `Curvature, ${what} in ${frame}, in rad/${per}. A small loop, ` +
      "counter-clockwise, turns the body by minus the curvature times its area.";
  }

  make() {
    const limits = this.plane.shown;
    const centre = this.centre.map(input => Number(input.value)), half = this.half.map(input => Number(input.value));
    const points = madeLoop(this.shape.value, centre, half, Number(this.angle.value) * Math.PI / 180);
    this.take(points.map(p => p.map((value, n) => Math.min(limits[n][1], Math.max(limits[n][0], value)))), this.shape.value);
  }

  // A loop to go round.
  take(points, kind) {
    Object.assign(this, {points, kind, spline: new PeriodicSpline(points), momentum: this.chosenMomentum()});
    // The time from one point to the next is the unit of the spline.
    const scaledMomentum = times(this.momentum, this.clock.duration / points.length);
    this.result = turnRound(this.inertia, this.spline, scaledMomentum, this.plane);
    this.byShape = norm(this.momentum) ? turnRound(this.inertia, this.spline, [0, 0, 0], this.plane) : this.result;
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

  save() {
    const names = this.plane.joints.map(joint => joint.name.replace(/\W+/g, "_"));
    const address = URL.createObjectURL(new Blob([this.csv()], {type: "text/csv"}));
    element("a", {href: address, download: `loop_${names.join("_")}.csv`}).click();
    setTimeout(() => URL.revokeObjectURL(address), 10000);
  }
}

unpackedData().then(data => { window.page = new Explorer(data); });
