// The turn of a body without momentum whose two joints go round a loop: R' = R hat(-A(r) r').
"use strict";

// Places within a step at which the connection is taken (Gauss), and the factor of their commutator.
const GAUSS = [0.5 - Math.sqrt(3) / 6, 0.5 + Math.sqrt(3) / 6];
const COMMUTATOR = Math.sqrt(3) / 12;
// Steps between two points of a loop, coarse and fine.
const STEPS = [3, 6];

// A(r) from its Chebyshev series: columns of the two joints.
class Connection {
  constructor({coefficients, degree, box}) {
    Object.assign(this, {coefficients, count: degree + 1, box});
    this.terms = [new Float64Array(degree + 1), new Float64Array(degree + 1)];
  }

  inside(place) {
    return [0, 1].every(n => place[n] >= this.box[n][0] && place[n] <= this.box[n][1]);
  }

  at(place) {
    const {count, coefficients, terms} = this;
    for (const n of [0, 1]) {
      const [low, high] = this.box[n];
      const x = (2 * place[n] - low - high) / (high - low);
      terms[n][0] = 1;
      terms[n][1] = x;
      for (let k = 2; k < count; k++) terms[n][k] = 2 * x * terms[n][k - 1] - terms[n][k - 2];
    }
    const sum = new Float64Array(6);
    for (let a = 0, k = 0; a < count; a++) {
      const row = new Float64Array(6);
      for (let b = 0; b < count; b++) for (let n = 0; n < 6; n++, k++) row[n] += coefficients[k] * terms[1][b];
      for (let n = 0; n < 6; n++) sum[n] += row[n] * terms[0][a];
    }
    return [[sum[0], sum[2], sum[4]], [sum[1], sum[3], sum[5]]];
  }

  // Angular velocity of the base, base axes.
  spin({place, rate}) {
    const [first, second] = this.at(place);
    return plus(times(first, -rate[0]), second, -rate[1]);
  }
}

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

// Attitudes at the ends of all steps: ordered products of exponentials of the series of Magnus, of order four.
function attitudesAlong(connection, spline, stepsBetween) {
  const step = 1 / stepsBetween;
  const found = [[0, 0, 0, 1]];
  for (let k = 0; k < spline.count * stepsBetween; k++) {
    const [one, other] = GAUSS.map(share => connection.spin(spline.at((k + share) * step)));
    const turn = plus(times(plus(one, other), 0.5 * step), cross(one, other), COMMUTATOR * step * step);
    found.push(quaternionProduct(found[k], quaternionOfVector(turn)));
  }
  return found;
}

// The turn round a loop [rotation vector, rad], the attitudes on the way, and how far the turn may be off [rad].
function turnRound(connection, spline, seriesError) {
  const [coarse, fine] = STEPS.map(steps => attitudesAlong(connection, spline, steps));
  const [q, rough] = [fine[fine.length - 1], coarse[coarse.length - 1]];
  const difference = quaternionProduct([-rough[0], -rough[1], -rough[2], rough[3]], q);
  let length = 0, inside = true;
  const count = spline.count * STEPS[1];
  for (let k = 0; k < count; k++) {
    const {place, rate} = spline.at((k + 0.5) / STEPS[1]);
    length += (Math.abs(rate[0]) + Math.abs(rate[1])) / STEPS[1];
    inside &&= connection.inside(place);
  }
  // Halving steps of order four leaves a sixteenth of the error; half of the difference is said.
  const bySteps = 0.5 * norm(vectorOfQuaternion(difference)) + 1e-13 * count;
  return {vector: vectorOfQuaternion(q), attitudes: fine, inside, bySteps, bySeries: seriesError * length};
}
