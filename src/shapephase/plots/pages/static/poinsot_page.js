// Poinsot's description: the ellipsoid of inertia on its plane, the curves that the point of contact draws, and plots.
"use strict";

// Half width of a curve, over the reach of the ellipsoid; and how far it stands off what it is drawn on.
const CURVE_WIDTH = 0.012;
const CURVE_LIFT = 0.004;
// Radius of the dot at the contact, and steps of a circle.
const CONTACT_RADIUS = 0.035;
const AROUND = 120;
const ROLLING_COLOURS = {
  herpolhode: [0.902, 0.624, 0, 1], polhode: [0, 0.447, 0.698, 1], "angular velocity": [0, 0.62, 0.451, 1],
  "invariable plane": [0.62, 0.64, 0.67, 1], ellipsoid: [0.2, 0.4, 0.52, 1],
};

// A ribbon along points, six corners for each chord, as broad as twice `half`, at right angles to the normals.
function ribbon(points, normals, half, lift) {
  const count = points.length, positions = new Float32Array(18 * (count - 1)), shades = new Float32Array(18 * (count - 1));
  const sides = points.map((point, k) => {
    const ahead = plus(points[Math.min(k + 1, count - 1)], points[Math.max(k - 1, 0)], -1);
    const side = times(unit(cross(normals[k], ahead)), half), up = plus(point, normals[k], lift);
    return [plus(up, side), plus(up, side, -1)];
  });
  for (let k = 0; k + 1 < count; k++) {
    const [[a, b], [c, d]] = [sides[k], sides[k + 1]];
    positions.set([...a, ...b, ...c, ...c, ...b, ...d], 18 * k);
    for (let n = 0; n < 6; n++) shades.set(normals[k], 18 * k + 3 * n);
  }
  return {positions, normals: shades};
}

class RollingEllipsoid {
  constructor(data, rolling) {
    this.rolling = rolling;
    Object.assign(this, playMotion(data, figure => this.addTo(figure)));
    this.clock.onChange(() => this.mark());
  }

  // The parts that only this page has, in groups of the legend.
  addTo(figure) {
    const {scene, data} = figure, {rolling} = this, reach = data.reach;
    const add = (group, mesh, colour, lines = false) => {
      figure.groups[group] ??= [];
      return figure.into(group, scene.add(scene.upload(mesh, lines), colour));
    };
    const rows = array => Array.from({length: array.length / 3}, (_, k) => Array.from(row(array, k, 3)));
    const up = times(unit(data.momentum), -1), contact = rows(rolling.contact);
    const flat = contact.map(() => up), pale = ([r, g, b]) => [1 - 0.4 * (1 - r), 1 - 0.4 * (1 - g), 1 - 0.4 * (1 - b), 1];
    const round = radius => Array.from({length: AROUND + 1}, (_, k) => {
      const angle = 2 * Math.PI * k / AROUND;
      return plus(plus(rolling.foot, rolling.across, radius * Math.cos(angle)), rolling.along, radius * Math.sin(angle));
    });
    const half = CURVE_WIDTH * reach, plane = ROLLING_COLOURS["invariable plane"];
    add("invariable plane", {positions: rolling.lines}, [0.8, 0.82, 0.84, 1], true);
    for (const radius of [rolling.radius, ...rolling.annulus]) {
      if (radius) add("invariable plane", ribbon(round(radius), round(radius).map(() => up), 0.3 * half, 0), plane);
    }
    if (rolling.annulus[1]) {
      add("herpolhode", ribbon(contact, flat, 0.6 * half, 0.5 * CURVE_LIFT * reach), pale(ROLLING_COLOURS.herpolhode));
      this.drawn = add("herpolhode", ribbon(contact, flat, half, CURVE_LIFT * reach), ROLLING_COLOURS.herpolhode);
      const polhode = rows(rolling.polhode), I = rolling.inertia;
      const outwards = polhode.map(w => unit([0, 1, 2].map(k => dot(I.slice(3 * k, 3 * k + 3), w))));
      this.riding = [add("polhode", ribbon(polhode, outwards, half, CURVE_LIFT * reach), ROLLING_COLOURS.polhode)];
    } else this.riding = [];
    // Where the planes of its axes cut the ellipsoid: without them nobody would see a round one turn.
    const {dimensions, pose} = data.nodes[0].shapes[0];
    for (const [a, b] of [[0, 1], [1, 2], [2, 0]]) {
      const points = Array.from({length: AROUND + 1}, (_, k) => {
        const point = [0, 0, 0], angle = 2 * Math.PI * k / AROUND;
        point[a] = dimensions[a] * Math.cos(angle);
        point[b] = dimensions[b] * Math.sin(angle);
        return turned(pose, point);
      });
      const I = rolling.inertia, outwards = points.map(w => unit([0, 1, 2].map(k => dot(I.slice(3 * k, 3 * k + 3), w))));
      this.riding.push(add("body", ribbon(points, outwards, 0.25 * half, 0), ROLLING_COLOURS.ellipsoid));
    }
    this.arrow = add("angular velocity", arrowMesh(0.014, 0.13, 0.036), ROLLING_COLOURS["angular velocity"]);
    this.dot = add("angular velocity", sphereMesh(CONTACT_RADIUS * reach), ROLLING_COLOURS["angular velocity"]);
  }

  // The angular velocity at the time of the clock, in space.
  mark() {
    const {figure} = this, place = this.clock.place();
    this.contact = figure.between(this.rolling.contact, place);
    const long = norm(this.contact);
    this.arrow.pose = product(poseAlong(this.contact), scaled(long, long, long));
    this.dot.pose = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...this.contact, 1];
    for (const solid of this.riding) solid.pose = figure.base;
    if (this.drawn) this.drawn.uploaded.count = 6 * place.frame;
    this.scene.invalidate();
  }
}

unpackedData().then(data => {
  window.page = new RollingEllipsoid(data.motion, data.rolling);
  page.plots = data.plots.map(plot => new TimePlot(document.getElementById("plots"), plot, page.clock));
  page.clock.play(true);
});
