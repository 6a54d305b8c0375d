// A scene in three dimensions by WebGL 2: solids, see-through ghosts, lines and labels, and a camera to turn by hand.
"use strict";

// Vertical field of view [rad]: like that of a lens of 50 mm, without distortion at the edges.
const FIELD_OF_VIEW = 0.7;

// Of labels: their font, half the height of a line of it, and the least distance from an arrow's tip [px].
const LABEL_FONT = "13px system-ui, sans-serif";
const LABEL_HALF_HEIGHT = 8;
const LABEL_GAP = 7;

// Rounds in which the camera finds the middle of what it is to show: it is then within a pixel.
const CENTRING_ROUNDS = 5;

const VERTEX_SHADER = `#version 300 es
uniform mat4 view, projection, model;
uniform mat3 turn;
in vec3 position, normal;
out vec3 place, upright;
void main() {
  vec4 there = view * model * vec4(position, 1.0);
  place = there.xyz;
  upright = mat3(view) * (turn * normal);
  gl_Position = projection * there;
}`;

const FRAGMENT_SHADER = `#version 300 es
precision highp float;
uniform vec4 colour;
uniform vec3 up;
uniform float lit;
in vec3 place, upright;
out vec4 shown;
void main() {
  vec3 n = normalize(upright), eye = normalize(-place);
  if (dot(n, eye) < 0.0) n = -n;
  vec3 key = normalize(vec3(0.45, 0.65, 0.85));
  float light = 0.50 + 0.14 * dot(n, up) + 0.42 * max(dot(n, key), 0.0);
  float gloss = 0.12 * pow(max(dot(n, normalize(key + eye)), 0.0), 40.0);
  vec3 hue = lit > 0.5 ? colour.rgb * light + gloss : colour.rgb;
  shown = vec4(hue * colour.a, colour.a);
}`;

class Scene3D {
  // A canvas with WebGL, and over it one for lines and labels that nothing may hide.
  constructor(holder) {
    this.holder = holder;
    this.canvas = holder.appendChild(document.createElement("canvas"));
    this.overlay = holder.appendChild(document.createElement("canvas"));
    this.overlay.className = "overlay";
    this.gl = this.canvas.getContext("webgl2", {antialias: true, premultipliedAlpha: true, preserveDrawingBuffer: true});
    this.solids = [];
    this.drawOver = [];
    this.world = IDENTITY;
    this.up = [0, 0, 1];
    this.camera = {target: [0, 0, 0], distance: 5, azimuth: 0.9, elevation: 0.35};
    if (this.gl) this.program = this.compiled();
    else holder.insertAdjacentText("beforeend", "This browser shows no WebGL.");
    this.listen();
    new ResizeObserver(() => this.invalidate()).observe(holder);
  }

  compiled() {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "position");
    gl.bindAttribLocation(program, 1, "normal");
    gl.linkProgram(program);
    this.at = {};
    for (const name of ["view", "projection", "model", "turn", "colour", "up", "lit"]) {
      this.at[name] = gl.getUniformLocation(program, name);
    }
    return program;
  }

  // Bring triangles or lines to the graphics card once; several solids may share them.
  upload(mesh, lines = false) {
    if (!this.gl) return {count: 0};
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    for (const [place, values] of [[0, mesh.positions], [1, mesh.normals]]) {
      if (!values) continue;
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    }
    return {array, count: mesh.positions.length / 3, mode: lines ? gl.LINES : gl.TRIANGLES, lines};
  }

  // Something to draw: its `pose` may be changed at any time; `colour` is red, green, blue, opacity from 0 to 1.
  add(uploaded, colour, pose = IDENTITY) {
    const solid = {uploaded, colour, pose, visible: true};
    this.solids.push(solid);
    return solid;
  }

  invalidate() {
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => { this.waiting = 0; this.draw(); });
  }

  // Right, back and up of the camera in the axes that it is fixed to.
  cameraAxes() {
    const up = this.up;
    const side = Math.abs(up[0]) > 0.9 ? [0, 1, 0] : [1, 0, 0];
    const first = unit(plus(side, up, -dot(side, up))), second = cross(up, first);
    const {azimuth, elevation} = this.camera;
    const flat = plus(times(first, Math.cos(azimuth)), second, Math.sin(azimuth));
    const back = plus(times(flat, Math.cos(elevation)), up, Math.sin(elevation));
    const right = plus(times(second, Math.cos(azimuth)), first, -Math.sin(azimuth));
    return {right, back, above: cross(back, right)};
  }

  view() {
    const {right, back, above} = this.cameraAxes();
    const eye = plus(this.camera.target, back, this.camera.distance);
    return [
      right[0], above[0], back[0], 0, right[1], above[1], back[1], 0, right[2], above[2], back[2], 0,
      -dot(right, eye), -dot(above, eye), -dot(back, eye), 1,
    ];
  }

  // As near as all these points are seen.
  fit(points, margin = 1.12) {
    const low = [0, 1, 2].map(k => Math.min(...points.map(p => p[k])));
    const high = [0, 1, 2].map(k => Math.max(...points.map(p => p[k])));
    this.camera.target = times(plus(low, high), 0.5);
    const {right, back, above} = this.cameraAxes();
    const aspect = Math.max(this.holder.clientWidth, 1) / Math.max(this.holder.clientHeight, 1);
    const tangent = Math.tan(0.5 * FIELD_OF_VIEW);
    // The middle of what is seen is not that of the points: near ones are further from it. Each round halves the rest, or more.
    for (let round = 0; round < CENTRING_ROUNDS; round++) {
      const offsets = points.map(point => plus(point, this.camera.target, -1));
      const needed = offsets.map(d => dot(d, back) + Math.max(Math.abs(dot(d, right)) / aspect, Math.abs(dot(d, above))) / tangent);
      this.camera.distance = margin * Math.max(1e-6, ...needed);
      if (round === CENTRING_ROUNDS - 1) break;
      for (const axis of [right, above]) {
        const seen = offsets.map(d => dot(d, axis) / (this.camera.distance - dot(d, back)));
        const middle = 0.5 * (Math.min(...seen) + Math.max(...seen));
        this.camera.target = plus(this.camera.target, axis, middle * this.camera.distance);
      }
    }
    this.invalidate();
  }

  draw() {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = [this.holder.clientWidth, this.holder.clientHeight];
    if (!width || !height) return;
    for (const canvas of [this.canvas, this.overlay]) {
      const [across, down] = [Math.round(width * ratio), Math.round(height * ratio)];
      if (canvas.width !== across || canvas.height !== down) { canvas.width = across; canvas.height = down; }
    }
    const far = 40 * this.camera.distance;
    this.projection = perspective(FIELD_OF_VIEW, width / height, this.camera.distance / 60, far);
    this.seen = this.view();
    if (this.gl) this.drawSolids();
    const pen = this.overlay.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    for (const draw of this.drawOver) draw(pen, point => this.onScreen(point, width, height));
  }

  drawSolids() {
    const gl = this.gl, at = this.at;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.useProgram(this.program);
    const seen = product(this.seen, this.world);
    gl.uniformMatrix4fv(at.view, false, seen);
    gl.uniformMatrix4fv(at.projection, false, this.projection);
    gl.uniform3fv(at.up, turned(this.seen, this.up));
    const shown = this.solids.filter(solid => solid.visible && solid.uploaded.count);
    gl.disable(gl.BLEND);
    for (const solid of shown) if (solid.colour[3] >= 1) this.drawSolid(solid);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const clear = shown.filter(solid => solid.colour[3] < 1);
    // Depths first, so that of each see-through body only the front is seen; a little behind, so that a solid one in the
    // same place is seen before it.
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 2);
    gl.colorMask(false, false, false, false);
    for (const solid of clear) this.drawSolid(solid);
    gl.colorMask(true, true, true, true);
    for (const solid of clear) this.drawSolid(solid);
    gl.disable(gl.POLYGON_OFFSET_FILL);
  }

  drawSolid({uploaded, colour, pose}) {
    const gl = this.gl, at = this.at;
    gl.uniformMatrix4fv(at.model, false, pose);
    gl.uniformMatrix3fv(at.turn, false, normalMatrix(pose));
    gl.uniform4fv(at.colour, colour);
    gl.uniform1f(at.lit, uploaded.lines ? 0 : 1);
    gl.bindVertexArray(uploaded.array);
    gl.drawArrays(uploaded.mode, 0, uploaded.count);
  }

  // Pixels of a point in the axes of the world; null behind the camera.
  onScreen(point, width, height) {
    const p = moved(this.seen, moved(this.world, point));
    if (p[2] > -1e-9) return null;
    const f = this.projection;
    return [0.5 * width * (1 + f[0] * p[0] / -p[2]), 0.5 * height * (1 - f[5] * p[1] / -p[2])];
  }

  listen() {
    const held = new Map();
    let apart = 0;
    const holder = this.holder;
    holder.tabIndex = 0;
    holder.addEventListener("pointerdown", event => {
      held.set(event.pointerId, [event.clientX, event.clientY]);
      holder.setPointerCapture(event.pointerId);
      apart = 0;
    });
    const release = event => held.delete(event.pointerId);
    holder.addEventListener("pointerup", release);
    holder.addEventListener("pointercancel", release);
    holder.addEventListener("pointermove", event => {
      const before = held.get(event.pointerId);
      if (!before) return;
      const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
      held.set(event.pointerId, [event.clientX, event.clientY]);
      if (held.size === 2) {
        const [a, b] = [...held.values()];
        const now = Math.hypot(a[0] - b[0], a[1] - b[1]);
        if (apart) this.camera.distance *= apart / now;
        apart = now;
      } else if (event.shiftKey || event.buttons === 2) {
        const {right, above} = this.cameraAxes();
        const size = 2 * this.camera.distance * Math.tan(0.5 * FIELD_OF_VIEW) / holder.clientHeight;
        this.camera.target = plus(plus(this.camera.target, right, -dx * size), above, dy * size);
      } else {
        this.camera.azimuth -= 0.008 * dx;
        this.camera.elevation = Math.min(1.57, Math.max(-1.57, this.camera.elevation + 0.008 * dy));
      }
      this.invalidate();
    });
    holder.addEventListener("contextmenu", event => event.preventDefault());
    // In a page that scrolls, the wheel scrolls it until somebody clicks into the scene.
    holder.addEventListener("wheel", event => {
      const scrolls = document.documentElement.scrollHeight > innerHeight;
      if (scrolls && document.activeElement !== holder && !event.ctrlKey) return;
      event.preventDefault();
      this.camera.distance *= Math.exp(0.001 * event.deltaY);
      this.invalidate();
    }, {passive: false});
  }
}

// A text beyond the tip of an arrow, so far that it does not stand on it.
function labelBeyond(pen, foot, tip, text, colour) {
  if (!foot || !tip) return;
  pen.font = LABEL_FONT;
  const along = [tip[0] - foot[0], tip[1] - foot[1]], long = Math.hypot(...along);
  const [x, y] = long > 1 ? along.map(part => part / long) : [0, -1];
  const half = 0.5 * pen.measureText(text).width;
  const away = LABEL_GAP + Math.min(half / Math.max(Math.abs(x), 1e-3), LABEL_HALF_HEIGHT / Math.max(Math.abs(y), 1e-3));
  label(pen, [tip[0] + away * x, tip[1] + away * y], text, colour);
}

function label(pen, at, text, colour = "#333", align = "center") {
  if (!at) return;
  pen.font = LABEL_FONT;
  pen.textAlign = align;
  // A text in the middle of its place stays inside the picture.
  if (align === "center") {
    const half = 0.5 * pen.measureText(text).width + 4;
    at = [Math.max(half, Math.min(pen.canvas.clientWidth - half, at[0])), at[1]];
  }
  pen.textBaseline = "middle";
  pen.lineWidth = 3;
  pen.strokeStyle = "rgba(255, 255, 255, 0.85)";
  pen.strokeText(text, at[0], at[1]);
  pen.fillStyle = colour;
  pen.fillText(text, at[0], at[1]);
}
