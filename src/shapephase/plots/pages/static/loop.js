// Closed loops in the plane of two joints: points drawn or made, and the periodic cubic spline through them.
"use strict";

// Points of a loop, evenly in time.
const LOOP_POINTS = 64;
// Points of a file's loop: of more, every second or third is taken.
const MOST_POINTS = 256;
// Sweeps of Gauss and Seidel, each of which makes the error of a spline's bends four times smaller or more.
const SWEEPS = 40;

const SHAPES = {
  circle: s => [Math.cos(s), Math.sin(s)],
  // A square with rounded corners, which a spline can follow.
  square: s => {
    const size = (Math.abs(Math.cos(s)) ** 6 + Math.abs(Math.sin(s)) ** 6) ** (-1 / 6);
    return [size * Math.cos(s), size * Math.sin(s)];
  },
  "Lissajous 1 : 2": s => [Math.sin(s), Math.sin(2 * s)],
  "Lissajous 2 : 3": s => [Math.sin(2 * s), Math.sin(3 * s)],
};

// Points of a named shape within the unit square.
const unitLoop = name => Array.from({length: LOOP_POINTS}, (_, k) => SHAPES[name](2 * Math.PI * k / LOOP_POINTS));

// A loop of the unit square about a centre, with half widths, turned by an angle.
function placedLoop(points, centre, half, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return points.map(([x, y]) => [centre[0] + half[0] * (c * x - s * y), centre[1] + half[1] * (s * x + c * y)]);
}

// Centre and half widths of a loop.
function extentOf(points) {
  const ends = [0, 1].map(n => { const values = points.map(p => p[n]); return [Math.min(...values), Math.max(...values)]; });
  return {centre: ends.map(([low, high]) => 0.5 * (low + high)), half: ends.map(([low, high]) => 0.5 * (high - low) || 1e-9)};
}

// Points of two joints in the text of a CSV file, [rad or m]; an error where it has no such columns.
function loopOfFile(text, joints) {
  const rows = text.split(/\r?\n/).filter(line => line.trim() && !line.startsWith("#"))
    .map(line => line.split(/[,;\t]/).map(cell => cell.trim().replace(/^"|"$/g, "")));
  const places = joints.map(({name}) => rows[0].findIndex(cell => cell.replace(/ *\[.*\]$/, "") === name));
  const factors = places.map(place => /\[(deg|°)\]$/.test(rows[0][place]) ? Math.PI / 180 : 1);
  let points = rows.slice(1).map(row => places.map((place, n) => factors[n] * Number(row[place])));
  if (places.includes(-1) || points.length < 4 || !points.flat().every(Number.isFinite)) {
    throw new Error(`no loop of ${joints.map(({name}) => name).join(" and ")} in this file`);
  }
  const gap = [0, 1].map(n => points[points.length - 1][n] - points[0][n]);
  if (Math.hypot(...gap) < 1e-6) points = points.slice(0, -1);
  const every = Math.ceil(points.length / MOST_POINTS);
  return points.filter((_, k) => k % every === 0);
}

// Of the points of a pointer: evenly along the closed line, and smooth where the hand was not.
function handLoop(points, widths) {
  const closed = [...points, points[0]];
  const along = [0];
  for (let k = 1; k < closed.length; k++) {
    const step = [0, 1].map(n => (closed[k][n] - closed[k - 1][n]) / widths[n]);
    along.push(along[k - 1] + Math.hypot(...step));
  }
  const total = along[along.length - 1];
  let found = [];
  for (let k = 0, place = 0; k < LOOP_POINTS; k++) {
    const goal = total * k / LOOP_POINTS;
    while (along[place + 1] < goal) place += 1;
    const share = (goal - along[place]) / (along[place + 1] - along[place] || 1);
    found.push([0, 1].map(n => closed[place][n] + share * (closed[place + 1][n] - closed[place][n])));
  }
  for (let round = 0; round < 2; round++) {
    found = found.map((p, k) => [0, 1].map(n =>
      0.25 * found[(k + LOOP_POINTS - 1) % LOOP_POINTS][n] + 0.5 * p[n] + 0.25 * found[(k + 1) % LOOP_POINTS][n]));
  }
  return found;
}

// The periodic cubic spline through points that are one unit of time apart: place and rate at any time.
class PeriodicSpline {
  constructor(points) {
    this.points = points;
    this.count = points.length;
    this.bends = points.map(() => [0, 0]);
    for (let sweep = 0; sweep < SWEEPS; sweep++) {
      for (let k = 0; k < this.count; k++) {
        const [before, after] = [(k + this.count - 1) % this.count, (k + 1) % this.count];
        for (const n of [0, 1]) {
          const second = 6 * (points[after][n] - 2 * points[k][n] + points[before][n]);
          this.bends[k][n] = (second - this.bends[before][n] - this.bends[after][n]) / 4;
        }
      }
    }
  }

  at(time) {
    const k = Math.min(Math.floor(time), this.count - 1), s = time - k, r = 1 - s, next = (k + 1) % this.count;
    const place = [0, 0], rate = [0, 0];
    for (const n of [0, 1]) {
      const [p, q, a, b] = [this.points[k][n], this.points[next][n], this.bends[k][n], this.bends[next][n]];
      place[n] = r * p + s * q + ((r ** 3 - r) * a + (s ** 3 - s) * b) / 6;
      rate[n] = q - p + ((1 - 3 * r * r) * a + (3 * s * s - 1) * b) / 6;
    }
    return {place, rate};
  }
}
