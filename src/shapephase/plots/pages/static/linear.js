// Vectors are arrays of 3, quaternions x y z w, poses 4 x 4 in columns, as WebGL takes them.
"use strict";

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const plus = (a, b, factor = 1) => [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]];
const times = (a, factor) => [a[0] * factor, a[1] * factor, a[2] * factor];
const norm = a => Math.hypot(a[0], a[1], a[2]);
const unit = a => times(a, 1 / (norm(a) || 1));

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

function product(a, b) {
  const c = new Array(16);
  for (let column = 0; column < 4; column++) {
    for (let line = 0; line < 4; line++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * k + line] * b[4 * column + k];
      c[4 * column + line] = sum;
    }
  }
  return c;
}

function poseOfQuaternion([x, y, z, w], [px, py, pz]) {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0,
    2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0,
    2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0,
    px, py, pz, 1,
  ];
}

// Of three rows of three, as Python writes a matrix.
function poseOfRows(m, p) {
  return [m[0], m[3], m[6], 0, m[1], m[4], m[7], 0, m[2], m[5], m[8], 0, p[0], p[1], p[2], 1];
}

// A turn by an angle about a unit vector.
function poseOfTurn(axis, angle, place = [0, 0, 0]) {
  const half = Math.sin(0.5 * angle);
  return poseOfQuaternion([axis[0] * half, axis[1] * half, axis[2] * half, Math.cos(0.5 * angle)], place);
}

// The shortest turn that takes e_z to a direction.
function poseAlong(direction, place = [0, 0, 0]) {
  const d = unit(direction);
  const axis = [-d[1], d[0], 0];
  if (norm(axis) < 1e-9) return poseOfTurn([1, 0, 0], d[2] > 0 ? 0 : Math.PI, place);
  return poseOfTurn(unit(axis), Math.atan2(norm(axis), d[2]), place);
}

const scaled = (a, b, c) => [a, 0, 0, 0, 0, b, 0, 0, 0, 0, c, 0, 0, 0, 0, 1];
const turned = (m, v) => [0, 1, 2].map(k => m[k] * v[0] + m[4 + k] * v[1] + m[8 + k] * v[2]);
const moved = (m, v) => [0, 1, 2].map(k => m[k] * v[0] + m[4 + k] * v[1] + m[8 + k] * v[2] + m[12 + k]);
const placeOf = m => [m[12], m[13], m[14]];

// Of a pose without stretching.
function inverse(m) {
  const p = placeOf(m);
  const back = [m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0, 0, 0, 0, 1];
  const q = turned(back, p);
  return [...back.slice(0, 12), -q[0], -q[1], -q[2], 1];
}

// How normals turn: the cofactors, which need no division and stand in columns as WebGL takes them.
function normalMatrix(m) {
  const [a, b, c] = [m.slice(0, 3), m.slice(4, 7), m.slice(8, 11)];
  return [...cross(b, c), ...cross(c, a), ...cross(a, b)];
}

function perspective(fieldOfView, aspect, near, far) {
  const f = 1 / Math.tan(0.5 * fieldOfView);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
}

// Between two quaternions, along the shorter arc.
function slerp(a, b, share) {
  let cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const sign = cosine < 0 ? -1 : 1;
  cosine = Math.min(1, cosine * sign);
  const angle = Math.acos(cosine);
  const small = angle < 1e-4;
  const first = small ? 1 - share : Math.sin((1 - share) * angle) / Math.sin(angle);
  const second = sign * (small ? share : Math.sin(share * angle) / Math.sin(angle));
  const q = [0, 1, 2, 3].map(k => first * a[k] + second * b[k]);
  const length = Math.hypot(...q);
  return q.map(value => value / length);
}

function quaternionOf(m) {
  const [a, b, c, d] = [1 + m[0] + m[5] + m[10], 1 + m[0] - m[5] - m[10], 1 - m[0] + m[5] - m[10],
    1 - m[0] - m[5] + m[10]];
  const most = Math.max(a, b, c, d);
  const s = 2 * Math.sqrt(most);
  if (most === a) return [(m[6] - m[9]) / s, (m[8] - m[2]) / s, (m[1] - m[4]) / s, s / 4];
  if (most === b) return [s / 4, (m[1] + m[4]) / s, (m[8] + m[2]) / s, (m[6] - m[9]) / s];
  if (most === c) return [(m[1] + m[4]) / s, s / 4, (m[6] + m[9]) / s, (m[8] - m[2]) / s];
  return [(m[8] + m[2]) / s, (m[6] + m[9]) / s, s / 4, (m[1] - m[4]) / s];
}
