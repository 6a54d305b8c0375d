// The map of the curvature over two joints, and the loop on it: drawn by a pointer.
"use strict";

// Red, green and blue of a colour #RRGGBB.
const channels = hex => [1, 3, 5].map(k => parseInt(hex.slice(k, k + 2), 16));

// Room for numbers and names [px]: left, right, above, below.
const MAP_ROOM = [58, 12, 12, 46];

// Across the map: signs where the field is at least that part of its largest, so that grey tells the sign, too.
const SIGNS = 9;
const SIGNED = 0.12;

// A name and what follows it within some pixels: of a longer one the middle is left out.
function fitting(pen, name, after, room) {
  pen.font = LABEL_FONT;
  for (let kept = name.length; ; kept--) {
    const text = kept < name.length ? `${name.slice(0, Math.ceil(kept / 2))}…${name.slice(name.length - Math.floor(kept / 2))}` : name;
    if (kept < 2 || pen.measureText(text + after).width <= room) return text + after;
  }
}

class CurvatureMap {
  constructor(holder, plane) {
    Object.assign(this, {holder, plane, gauge: "least perturbation", component: "largest", points: [], listeners: []});
    this.canvas = holder.appendChild(document.createElement("canvas"));
    this.hues = [plane.colours.negative, plane.colours.positive].map(channels);
    this.picture = document.createElement("canvas");
    this.picture.width = this.picture.height = plane.map;
    this.colour();
    new ResizeObserver(() => this.draw()).observe(holder);
    this.listen();
  }

  // Of the component that is shown: x, y, z, or along the axis where the field is largest on the whole.
  values() {
    const field = this.plane.curvature[this.gauge], count = this.plane.map ** 2;
    if (this.component === "magnitude") return Float32Array.from({length: count}, (_, k) => norm(row(field, k, 3)));
    let axis = ["x", "y", "z"].indexOf(this.component);
    if (axis < 0) {
      const sizes = [0, 1, 2].map(n => { let sum = 0; for (let k = n; k < 3 * count; k += 3) sum += field[k] ** 2; return sum; });
      axis = sizes.indexOf(Math.max(...sizes));
    }
    this.axis = "xyz"[axis];
    return Float32Array.from({length: count}, (_, k) => field[3 * k + axis]);
  }

  colour() {
    const values = this.shownValues = this.values(), count = this.plane.map;
    this.largest = values.reduce((most, value) => Math.max(most, Math.abs(value)), 1e-12);
    const pen = this.picture.getContext("2d"), image = pen.createImageData(count, count);
    for (let a = 0; a < count; a++) {
      for (let b = 0; b < count; b++) {
        const value = values[a * count + b] / this.largest, share = Math.abs(value);
        const hue = this.hues[value < 0 ? 0 : 1], place = 4 * ((count - 1 - b) * count + a);
        for (let n = 0; n < 3; n++) image.data[place + n] = 255 + share * (hue[n] - 255);
        image.data[place + 3] = 255;
      }
    }
    pen.putImageData(image, 0, 0);
    this.draw();
  }

  // Pixels of a place, and back.
  pixel([x, y]) {
    const [left, , top] = MAP_ROOM, [[a, b], [c, d]] = this.plane.shown;
    return [left + this.size * (x - a) / (b - a), top + this.size * (d - y) / (d - c)];
  }

  place([u, v]) {
    const [left, , top] = MAP_ROOM, [[a, b], [c, d]] = this.plane.shown;
    const clip = share => Math.min(1, Math.max(0, share));
    return [a + (b - a) * clip((u - left) / this.size), d - (d - c) * clip((v - top) / this.size)];
  }

  draw() {
    const ratio = Math.min(devicePixelRatio || 1, 2), width = this.holder.clientWidth;
    if (!width) return;
    this.size = Math.min(width, 560) - MAP_ROOM[0] - MAP_ROOM[1];
    const [across, down] = [Math.min(width, 560), this.size + MAP_ROOM[2] + MAP_ROOM[3]];
    [this.canvas.width, this.canvas.height] = [across * ratio, down * ratio];
    [this.canvas.style.width, this.canvas.style.height] = [`${across}px`, `${down}px`];
    const pen = this.canvas.getContext("2d");
    pen.scale(ratio, ratio);
    this.paint(pen);
  }

  // The map and the loop, by the pen of a canvas or an `SvgPen`.
  paint(pen) {
    pen.drawImage(this.picture, MAP_ROOM[0], MAP_ROOM[2], this.size, this.size);
    pen.strokeStyle = "#777";
    pen.strokeRect(MAP_ROOM[0], MAP_ROOM[2], this.size, this.size);
    if (this.component !== "magnitude") this.drawSigns(pen);
    this.drawScales(pen);
    if (this.spline) this.drawLoop(pen);
  }

  drawSigns(pen) {
    pen.font = LABEL_FONT;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillStyle = "rgba(0, 0, 0, 0.55)";
    const count = this.plane.map, values = this.shownValues;
    for (let a = 0; a < SIGNS; a++) {
      for (let b = 0; b < SIGNS; b++) {
        const [u, v] = [(a + 0.5) / SIGNS, (b + 0.5) / SIGNS];
        const value = values[Math.floor(u * count) * count + Math.floor(v * count)];
        if (Math.abs(value) < SIGNED * this.largest) continue;
        pen.fillText(value < 0 ? "−" : "+", MAP_ROOM[0] + u * this.size, MAP_ROOM[2] + (1 - v) * this.size);
      }
    }
  }

  drawScales(pen) {
    const bottom = MAP_ROOM[2] + this.size;
    this.plane.joints.forEach((joint, n) => {
      const factor = joint.unit === "rad" ? 180 / Math.PI : 1, [low, high] = this.plane.shown[n];
      for (const tick of ticks(low * factor, high * factor)) {
        const at = [...this.plane.shown.map(([first]) => first)];
        at[n] = tick / factor;
        const [u, v] = this.pixel(at);
        const text = typeset(Number(tick.toPrecision(6)));
        if (n === 0) label(pen, [u, bottom + 12], text); else label(pen, [MAP_ROOM[0] - 6, v], text, "#333", "right");
      }
      const name = fitting(pen, joint.name, ` [${joint.unit === "rad" ? "°" : "m"}]`, this.size);
      if (n === 0) label(pen, [MAP_ROOM[0] + this.size / 2, bottom + 33], name);
      else {
        pen.save();
        pen.translate(11, MAP_ROOM[2] + this.size / 2);
        pen.rotate(-Math.PI / 2);
        pen.textAlign = "center";
        pen.fillStyle = "#333";
        pen.fillText(name, 0, 0);
        pen.restore();
      }
    });
  }

  drawLoop(pen) {
    pen.lineWidth = 2.2;
    pen.strokeStyle = "#111";
    pen.beginPath();
    for (let k = 0; k <= 8 * this.spline.count; k++) {
      const [u, v] = this.pixel(this.spline.at(Math.min(k / 8, this.spline.count)).place);
      if (k) pen.lineTo(u, v); else pen.moveTo(u, v);
    }
    pen.stroke();
    // Which way round.
    const {place, rate} = this.spline.at(this.spline.count / 8);
    const [u, v] = this.pixel(place), [p, q] = this.pixel([place[0] + rate[0], place[1] + rate[1]]);
    const angle = Math.atan2(q - v, p - u);
    pen.fillStyle = "#111";
    pen.beginPath();
    for (const [r, turn] of [[11, 0], [8, 2.5], [8, -2.5]]) pen.lineTo(u + r * Math.cos(angle + turn), v + r * Math.sin(angle + turn));
    pen.fill();
    for (const [at, hue, size] of [[this.spline.points[0], "#009e73", 5], [this.now, "#0072b2", 6]]) {
      if (!at) continue;
      pen.fillStyle = hue;
      pen.strokeStyle = "white";
      pen.beginPath();
      pen.arc(...this.pixel(at), size, 0, 2 * Math.PI);
      pen.fill();
      pen.stroke();
    }
  }

  listen() {
    let drawn = null;
    const at = event => {
      const box = this.canvas.getBoundingClientRect();
      return this.place([event.clientX - box.left, event.clientY - box.top]);
    };
    this.canvas.addEventListener("pointerdown", event => {
      drawn = [at(event)];
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", event => {
      if (!drawn) return;
      drawn.push(at(event));
      if (drawn.length > 4) for (const listener of this.listeners) listener(drawn);
    });
    const release = () => { drawn = null; };
    this.canvas.addEventListener("pointerup", release);
    this.canvas.addEventListener("pointercancel", release);
  }
}
