// The turn of a body whose two joints go round a loop: R' = R hat(w), I(r) w = R^T L - J(r) r', L its angular momentum.
"use strict";

// Steps between two points of a loop, coarse and fine.
const STEPS = [4, 8];

// I(r) and J(r) from their Chebyshev series; J by the columns of the two joints.
class PlaneInertia {
  constructor({inertia, momentum, degree, box}) {
    Object.assign(this, {inertia, momentum, count: degree + 1, box});
    this.terms = [new Float64Array(degree + 1), new Float64Array(degree + 1)];
  }

  inside(place) {
    return [0, 1].every(n => place[n] >= this.box[n][0] && place[n] <= this.box[n][1]);
  }

  sum(coefficients) {
    const {count, terms} = this, sum = new Float64Array(6), row = new Float64Array(6);
    for (let a = 0, k = 0; a < count; a++) {
      row.fill(0);
      for (let b = 0; b < count; b++) for (let n = 0; n < 6; n++, k++) row[n] += coefficients[k] * terms[1][b];
      for (let n = 0; n < 6; n++) sum[n] += row[n] * terms[0][a];
    }
    return sum;
  }

  // What does not turn with the body: the inverse of I (xx, yy, zz, yz, xz, xy), and J r'.
  at({place, rate}) {
    for (const n of [0, 1]) {
      const [low, high] = this.box[n], x = (2 * place[n] - low - high) / (high - low), values = this.terms[n];
      values[0] = 1;
      values[1] = x;
      for (let k = 2; k < this.count; k++) values[k] = 2 * x * values[k - 1] - values[k - 2];
    }
    const j = this.sum(this.momentum);
    const internal = [0, 1, 2].map(k => j[2 * k] * rate[0] + j[2 * k + 1] * rate[1]);
    return {inverse: inverseOfSymmetric(this.sum(this.inertia)), internal};
  }
}

function inverseOfSymmetric([xx, yy, zz, yz, xz, xy]) {
  const [a, b, c] = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
  const determinant = xx * a + xy * b + xz * c;
  return [a, xx * zz - xz * xz, xx * yy - xy * xy, xy * xz - xx * yz, c, b].map(value => value / determinant);
}

const symmetricTimes = ([xx, yy, zz, yz, xz, xy], [x, y, z]) =>
  [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z];

const symmetricSize = ([xx, yy, zz, yz, xz, xy]) => Math.sqrt(xx * xx + yy * yy + zz * zz + 2 * (yz * yz + xz * xz + xy * xy));

function quaternionProduct([a, b, c, d], [e, f, g, h]) {
  return [d * e + a * h + b * g - c * f, d * f - a * g + b * h + c * e, d * g + a * f - b * e + c * h,
    d * h - a * e - b * f - c * g];
}

function quaternionOfVector(v) {
  const angle = norm(v), factor = angle < 1e-6 ? 0.5 - angle * angle / 48 : Math.sin(0.5 * angle) / angle;
  return [...times(v, factor), Math.cos(0.5 * angle)];
}

function vectorOfQuaternion(q) {
  const sign = q[3] < 0 ? -1 : 1, size = norm(q);
  const angle = 2 * Math.atan2(size, Math.abs(q[3]));
  return times(q.slice(0, 3), sign * (size < 1e-9 ? 2 : angle / size));
}

// R v of a quaternion, and R^T v.
function turnedOn([x, y, z, w], v) {
  const u = [x, y, z], once = times(cross(u, v), 2);
  return plus(plus(v, once, w), cross(u, once));
}

const turnedBack = ([x, y, z, w], v) => turnedOn([-x, -y, -z, w], v);

// The rate of a rotation vector s, so that R exp(hat(s)) turns at w: the first terms are enough for order four.
function vectorRate(s, w) {
  const once = cross(s, w);
  return plus(plus(w, once, 0.5), cross(s, once), 1 / 12);
}

// Attitudes at the ends of all steps: ordered products of exponentials, by the rule of Runge, Kutta and Munthe-Kaas.
function attitudesAlong(inertia, spline, momentum, stepsBetween) {
  const step = 1 / stepsBetween, still = !norm(momentum), found = [[0, 0, 0, 1]], spins = [];
  const spin = ({inverse, internal}, turn) =>
    symmetricTimes(inverse, still ? times(internal, -1) : plus(turnedBack(turn, momentum), internal, -1));
  let start = inertia.at(spline.at(0));
  for (let k = 0; k < spline.count * stepsBetween; k++) {
    const turn = found[k], ahead = vector => quaternionProduct(turn, quaternionOfVector(vector));
    const [middle, end] = [0.5, 1].map(share => inertia.at(spline.at((k + share) * step)));
    const first = times(spin(start, turn), step);
    let half = times(first, 0.5);
    const second = times(vectorRate(half, spin(middle, ahead(half))), step);
    half = times(second, 0.5);
    const third = times(vectorRate(half, spin(middle, ahead(half))), step);
    const fourth = times(vectorRate(third, spin(end, ahead(third))), step);
    found.push(ahead(times(plus(plus(first, plus(second, third), 2), fourth), 1 / 6)));
    spins.push({inverse: middle.inverse, turn: ahead(half), size: norm(first) / step});
    start = end;
  }
  return {attitudes: found, spins};
}

// The turn round a loop [rotation vector, rad], the attitudes on the way, and how far the turn may be off [rad]. The unit
// of time is that from one point to the next, also in the momentum.
function turnRound(inertia, spline, momentum, plane) {
  const [coarse, fine] = STEPS.map(steps => attitudesAlong(inertia, spline, momentum, steps));
  const {attitudes} = fine, q = attitudes[attitudes.length - 1], rough = coarse.attitudes[coarse.attitudes.length - 1];
  const difference = quaternionProduct([-rough[0], -rough[1], -rough[2], rough[3]], q);
  const count = spline.count * STEPS[1], magnitude = norm(momentum);
  // An error e of the attitude in space goes on by e' = R I^-1 R^T (L x e): `onwards` takes it from a step to the end.
  let bySeries = 0, inside = true, onwards = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let k = count - 1; k >= 0; k--) {
    const {inverse, turn, size} = fine.spins[k], {place, rate} = spline.at((k + 0.5) / STEPS[1]);
    inside &&= inertia.inside(place);
    // An error of the series is one of the angular velocity: I^-1 (dJ r' + dI w).
    const spin = plane.inertia_error * size + plane.momentum_error * (Math.abs(rate[0]) + Math.abs(rate[1]));
    bySeries += symmetricSize(inverse) * spin * Math.hypot(...onwards.map(norm)) / STEPS[1];
    if (magnitude) {
      const back = line => times(cross(turnedOn(turn, symmetricTimes(inverse, turnedBack(turn, line))), momentum), 1 / STEPS[1]);
      onwards = onwards.map(line => { const once = back(line); return plus(plus(line, once), back(once), 0.5); });
    }
  }
  // Halving steps of order four leaves a sixteenth of the error; half of the difference is said.
  const bySteps = 0.5 * norm(vectorOfQuaternion(difference)) + 1e-13 * count;
  return {vector: vectorOfQuaternion(q), attitudes, inside, bySteps, bySeries};
}

// Nodes and weights of Gauss on [0, 1], and pieces of a ray from the middle of a loop.
const GAUSS = [[0.5 - Math.sqrt(0.15), 5 / 18], [0.5, 4 / 9], [0.5 + Math.sqrt(0.15), 5 / 18]];
const RAY_PIECES = 3;

// The turn that the curvature inside a loop stands for, minus its flux in base axes [rotation vector, rad]: by Stokes the
// integral of the connection round the loop, and of the bracket of its columns inside.
function fluxThrough(inertia, spline) {
  const {centre} = extentOf(spline.points);
  const turning = (place, rate) => { const {inverse, internal} = inertia.at({place, rate}); return symmetricTimes(inverse, internal); };
  let flux = [0, 0, 0];
  for (let k = 0; k < spline.count; k++) {
    for (const [share, weight] of GAUSS) {
      const {place, rate} = spline.at(k + share), arm = [place[0] - centre[0], place[1] - centre[1]];
      flux = plus(flux, turning(place, rate), -weight);
      const area = arm[0] * rate[1] - arm[1] * rate[0];
      for (let piece = 0; piece < RAY_PIECES; piece++) {
        for (const [node, part] of GAUSS) {
          const x = (piece + node) / RAY_PIECES, inner = [centre[0] + x * arm[0], centre[1] + x * arm[1]];
          const bracket = cross(turning(inner, [1, 0]), turning(inner, [0, 1]));
          flux = plus(flux, bracket, weight * part / RAY_PIECES * x * area);
        }
      }
    }
  }
  return flux;
}
