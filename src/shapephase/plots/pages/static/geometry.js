// Triangles with normals for what is drawn: {positions, normals}, three corners a triangle.
"use strict";

// Normals of a mesh are averaged over faces that meet at a vertex at less than this angle [cosine of 40 degrees].
const CREASE = 0.766;

// A profile of [radius, height, normal outwards, normal upwards], pieces apart, turned about z.
function turnedProfile(pieces, around = 28) {
  const positions = [], normals = [];
  const corner = ([r, z, outwards, upwards], angle) => {
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    positions.push(r * c, r * s, z);
    normals.push(outwards * c, outwards * s, upwards);
  };
  for (const piece of pieces) {
    for (let k = 0; k + 1 < piece.length; k++) {
      for (let n = 0; n < around; n++) {
        const [a, b] = [2 * Math.PI * n / around, 2 * Math.PI * (n + 1) / around];
        const [low, high] = [piece[k], piece[k + 1]];
        corner(low, a); corner(low, b); corner(high, b);
        corner(low, a); corner(high, b); corner(high, a);
      }
    }
  }
  return {positions: new Float32Array(positions), normals: new Float32Array(normals)};
}

function arc(radius, from, to, lift, count = 10) {
  const points = [];
  for (let k = 0; k <= count; k++) {
    const angle = from + (to - from) * k / count;
    points.push([radius * Math.cos(angle), radius * Math.sin(angle) + lift, Math.cos(angle), Math.sin(angle)]);
  }
  return points;
}

function sphereMesh(radius) {
  return turnedProfile([arc(radius, -Math.PI / 2, Math.PI / 2, 0, 18)]);
}

function capsuleMesh(radius, length) {
  const half = 0.5 * length;
  return turnedProfile([[...arc(radius, -Math.PI / 2, 0, -half), ...arc(radius, 0, Math.PI / 2, half)]]);
}

function cylinderMesh(radius, length) {
  const half = 0.5 * length;
  return turnedProfile([
    [[0, -half, 0, -1], [radius, -half, 0, -1]], [[radius, -half, 1, 0], [radius, half, 1, 0]],
    [[radius, half, 0, 1], [0, half, 0, 1]],
  ]);
}

// From the origin to (0, 0, 1).
function arrowMesh(radius, headLength, headRadius) {
  const neck = 1 - headLength;
  const [slope, rise] = [headLength / Math.hypot(headLength, headRadius), headRadius / Math.hypot(headLength, headRadius)];
  return turnedProfile([
    [[0, 0, 0, -1], [radius, 0, 0, -1]], [[radius, 0, 1, 0], [radius, neck, 1, 0]],
    [[radius, neck, 0, -1], [headRadius, neck, 0, -1]], [[headRadius, neck, slope, rise], [0, 1, slope, rise]],
  ], 20);
}

function boxMesh(x, y, z) {
  const positions = [], normals = [];
  const half = [x / 2, y / 2, z / 2];
  for (let axis = 0; axis < 3; axis++) {
    for (const side of [-1, 1]) {
      const place = (u, v) => {
        const p = [0, 0, 0], n = [0, 0, 0];
        p[axis] = side * half[axis];
        p[(axis + 1) % 3] = u * half[(axis + 1) % 3];
        p[(axis + 2) % 3] = v * half[(axis + 2) % 3];
        n[axis] = side;
        positions.push(...p); normals.push(...n);
      };
      place(-1, -1); place(1, -1); place(1, 1);
      place(-1, -1); place(1, 1); place(-1, 1);
    }
  }
  return {positions: new Float32Array(positions), normals: new Float32Array(normals)};
}

// A mesh of vertices and faces: smooth, with edges where faces meet at a large angle.
function facedMesh(vertices, faces) {
  const count = faces.length, own = new Float32Array(count), meeting = new Map();
  const keys = new Array(vertices.length / 3);
  for (let k = 0; k < keys.length; k++) keys[k] = row(vertices, k, 3).join();
  for (let face = 0; face < count; face += 3) {
    const [a, b, c] = [0, 1, 2].map(k => row(vertices, faces[face + k], 3));
    const normal = cross(plus(b, a, -1), plus(c, a, -1));
    own.set(normal, face);
    for (let k = 0; k < 3; k++) {
      const key = keys[faces[face + k]];
      if (!meeting.has(key)) meeting.set(key, []);
      meeting.get(key).push(face);
    }
  }
  const positions = new Float32Array(3 * count), normals = new Float32Array(3 * count);
  for (let corner = 0; corner < count; corner++) {
    const mine = own.subarray(3 * Math.floor(corner / 3), 3 * Math.floor(corner / 3) + 3);
    let sum = [0, 0, 0];
    for (const face of meeting.get(keys[faces[corner]])) {
      const other = own.subarray(face, face + 3);
      if (dot(mine, other) >= CREASE * norm(mine) * norm(other)) sum = plus(sum, other);
    }
    positions.set(row(vertices, faces[corner], 3), 3 * corner);
    normals.set(unit(sum), 3 * corner);
  }
  return {positions, normals};
}

// The triangles of a shape that Python described.
function meshOf(shape, meshes) {
  const size = shape.dimensions;
  if (shape.kind === "box") return boxMesh(...size);
  if (shape.kind === "cylinder") return cylinderMesh(size[0], size[1]);
  if (shape.kind === "capsule") return capsuleMesh(size[0], size[1]);
  if (shape.kind === "mesh") return facedMesh(meshes[shape.mesh].vertices, meshes[shape.mesh].faces);
  return sphereMesh(shape.kind === "sphere" ? size[0] : 1);
}
