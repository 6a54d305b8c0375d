// A page to draw a loop of two joints on: its turn, the body along it, and the loop as a file.
"use strict";

class Explorer {
  constructor(data) {
    this.plane = data.plane;
    Object.assign(this, playMotion(data.motion));
    this.connection = new Connection(this.plane);
    this.map = new CurvatureMap(document.getElementById("map"), this.plane);
    this.map.listeners.push(points => this.take(handLoop(points, this.plane.shown.map(([a, b]) => b - a)), "drawn"));
    this.controls();
    this.clock.onChange(() => this.mark());
    this.make();
  }

  // Sliders of a named loop, and what the map shows.
  controls() {
    const holder = document.getElementById("make"), {shown} = this.plane;
    this.shape = element("select", {onchange: () => this.make()});
    this.shape.setAttribute("aria-label", "shape of the loop");
    for (const name of Object.keys(SHAPES)) this.shape.append(element("option", {textContent: name}));
    holder.append(element("label", {}, "loop ", this.shape));
    const slider = (name, low, high, value) => {
      const made = element("input", {type: "range", min: low, max: high, step: "any", value, oninput: () => this.make()});
      holder.append(element("label", {className: "slider"}, element("span", {textContent: name}), made));
      return made;
    };
    const middles = shown.map(([a, b]) => 0.5 * (a + b)), halves = shown.map(([a, b]) => 0.5 * (b - a));
    this.centre = [0, 1].map(n => slider(`middle ${this.plane.joints[n].name}`, shown[n][0], shown[n][1], middles[n]));
    this.half = [0, 1].map(n => slider(`size ${this.plane.joints[n].name}`, 0.02 * halves[n], halves[n], 0.5 * halves[n]));
    this.angle = slider("turned", -Math.PI, Math.PI, 0);
    const reverse = element("button", {textContent: "other way round", onclick: () => {
      this.take([this.points[0], ...this.points.slice(1).reverse()], this.kind);
    }});
    const save = element("button", {id: "save", textContent: "save as CSV", onclick: () => this.save()});
    holder.append(reverse, save);
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
    document.getElementById("scale").textContent =
      `Curvature, ${what} in ${frame}: blue ${shortNumber(-largest)}, white 0, orange ${shortNumber(largest)} rad per ` +
      `${this.plane.joints.map(joint => joint.unit).join(" · ")}. A small loop, counter-clockwise, turns the body by minus ` +
      "the curvature times its area.";
  }

  make() {
    const limits = this.plane.shown;
    const centre = this.centre.map(input => Number(input.value)), half = this.half.map(input => Number(input.value));
    const points = madeLoop(this.shape.value, centre, half, Number(this.angle.value));
    this.take(points.map(p => p.map((value, n) => Math.min(limits[n][1], Math.max(limits[n][0], value)))), this.shape.value);
  }

  // A loop to go round.
  take(points, kind) {
    Object.assign(this, {points, kind, spline: new PeriodicSpline(points)});
    this.result = turnRound(this.connection, this.spline, this.plane.error);
    this.map.spline = this.spline;
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
    const {vector, bySteps, bySeries, inside} = this.result, angle = norm(vector), degrees = 180 / Math.PI;
    const axis = angle < 1e-12 ? "" : ` about (${times(vector, 1 / angle).map(v => (v + 0).toFixed(4)).join(", ")})`;
    document.getElementById("turn").textContent = `${(angle * degrees).toFixed(5)}°${axis}`;
    document.getElementById("radians").textContent = `${angle.toFixed(9)} rad`;
    const error = bySteps + bySeries;
    document.getElementById("error").textContent = inside
      ? `± ${error.toExponential(1)} rad: series ${bySeries.toExponential(1)}, steps ${bySteps.toExponential(1)}`
      : "The loop swings out of the map, where the page knows nothing: no certain number.";
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
