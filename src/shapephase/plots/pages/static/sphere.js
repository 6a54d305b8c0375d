// The sphere of momentum directions, turned by hand, with the curve so far and a dot for the clock's time.
"use strict";

// Corners that are those of a star.
const STAR = 5;
// Way from end to start, over the curve's size and at most 1, below which nobody sees that it is open.
const UNSEEN = 0.03;

class MomentumSphere {
  // `directions`: x y z for each frame of the clock, in the axes of the gauge.
  constructor(canvas, directions, clock) {
    Object.assign(this, {canvas, directions, clock, count: directions.length / 3});
    const fromStart = k => norm(plus(this.at(k), this.at(0), -1));
    const size = Math.min(1, Math.max(...Array.from({length: this.count}, (_, k) => fromStart(k))));
    const open = fromStart(this.count - 1) > UNSEEN * size;
    this.closing = open ? this.greatCircle(this.at(this.count - 1), this.at(0)) : [];
    // Beside the middle of the curve, so that most of it is in front.
    let middle = [0, 0, 0];
    for (let k = 0; k < this.count; k++) middle = plus(middle, this.at(k));
    const eye = norm(middle) > 0.2 * this.count ? unit(middle) : unit([0.75, 0.47, 0.45]);
    this.azimuth = Math.atan2(eye[1], eye[0]) + 0.35;
    this.elevation = Math.min(1.1, Math.max(-1.1, Math.asin(eye[2]) + 0.2));
    let held = false;
    canvas.addEventListener("pointerdown", event => { held = true; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { held = false; });
    canvas.addEventListener("pointermove", event => {
      if (!held) return;
      this.azimuth -= 0.01 * event.movementX;
      this.elevation = Math.min(1.57, Math.max(-1.57, this.elevation + 0.01 * event.movementY));
      this.draw();
    });
    new ResizeObserver(() => this.draw()).observe(canvas);
    clock.onChange(() => this.draw());
  }

  at(k) {
    return Array.from(row(this.directions, k, 3));
  }

  greatCircle(a, b) {
    const angle = Math.acos(Math.min(1, Math.max(-1, dot(a, b))));
    const points = [];
    for (let k = 0; k <= 40 && angle > 1e-6; k++) {
      const share = k / 40;
      points.push(unit(plus(times(a, Math.sin((1 - share) * angle)), b, Math.sin(share * angle))));
    }
    return points;
  }

  // Pixels, and how far in front.
  seen(point) {
    const [c, s, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    const right = dot(point, [-s, c, 0]), above = dot(point, [-se * c, -se * s, ce]);
    return [this.middle[0] + this.radius * right, this.middle[1] - this.radius * above, dot(point, [ce * c, ce * s, se])];
  }

  path(pen, points, colour, width, dashes = []) {
    pen.setLineDash(dashes);
    pen.lineWidth = width;
    for (const front of [false, true]) {
      pen.strokeStyle = colour;
      pen.globalAlpha = front ? 1 : 0.25;
      pen.beginPath();
      let before = null;
      for (const point of points) {
        const [x, y, depth] = this.seen(point);
        if ((depth >= 0) === front) {
          if (before) pen.lineTo(x, y); else pen.moveTo(x, y);
          before = true;
        } else before = null;
      }
      pen.stroke();
    }
    pen.globalAlpha = 1;
    pen.setLineDash([]);
  }

  // A mark with that many corners, or a star of five points: shapes, so that grey tells them, too. None is a disc.
  spot(pen, point, colour, radius, corners = 0) {
    const [x, y, depth] = this.seen(point);
    pen.globalAlpha = depth >= 0 ? 1 : 0.4;
    pen.fillStyle = colour;
    pen.strokeStyle = "white";
    pen.lineWidth = 1.5;
    pen.beginPath();
    if (!corners) pen.arc(x, y, radius, 0, 2 * Math.PI);
    const star = corners === STAR;
    for (let k = 0; k < (star ? 2 : 1) * corners; k++) {
      const angle = star ? Math.PI * (k / corners - 0.5) : Math.PI * (2 * k + 1) / corners;
      const reach = star && k % 2 ? 0.45 * radius : radius;
      pen.lineTo(x + reach * Math.cos(angle), y + reach * Math.sin(angle));
    }
    pen.closePath();
    pen.fill();
    pen.stroke();
    pen.globalAlpha = 1;
  }

  draw() {
    const {canvas} = this, ratio = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !height) return;
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    this.middle = [width / 2, height / 2];
    this.radius = 0.41 * Math.min(width, height);
    const shade = pen.createRadialGradient(this.middle[0] - 0.3 * this.radius, this.middle[1] - 0.4 * this.radius,
      0.1 * this.radius, ...this.middle, this.radius);
    shade.addColorStop(0, "#ffffff");
    shade.addColorStop(1, "#e3e8ee");
    pen.fillStyle = shade;
    pen.beginPath();
    pen.arc(...this.middle, this.radius, 0, 2 * Math.PI);
    pen.fill();
    pen.strokeStyle = "#9aa3ad";
    pen.lineWidth = 1;
    pen.stroke();
    this.graticule(pen);
    const {frame, share} = this.clock.place();
    this.current = unit(plus(times(this.at(frame), 1 - share), this.at(frame + 1), share));
    const all = Array.from({length: this.count}, (_, k) => this.at(k));
    this.path(pen, this.closing, "#d55e00", 1.5, [5, 3]);
    this.path(pen, all, "#9a9a9a", 1.3);
    this.path(pen, [...all.slice(0, frame + 1), this.current], "#000000", 2.2);
    this.spot(pen, all[0], "#009e73", 8, STAR);
    if (this.closing.length) this.spot(pen, all[this.count - 1], "#d55e00", 6, 4);
    this.spot(pen, this.current, "#0072b2", 6);
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, k) => {
      const [x, y, depth] = this.seen(times(axis, 1.13));
      label(pen, [x, y], "xyz"[k], depth >= 0 ? "#333" : "#aaa");
    });
  }

  graticule(pen) {
    const circle = (place, count = 48) => Array.from({length: count + 1}, (_, k) => place(2 * Math.PI * k / count));
    for (const latitude of [-Math.PI / 3, -Math.PI / 6, 0, Math.PI / 6, Math.PI / 3]) {
      const [c, s] = [Math.cos(latitude), Math.sin(latitude)];
      this.path(pen, circle(a => [c * Math.cos(a), c * Math.sin(a), s]), "#c3cad2", 0.6);
    }
    for (let k = 0; k < 6; k++) {
      const [c, s] = [Math.cos(k * Math.PI / 6), Math.sin(k * Math.PI / 6)];
      this.path(pen, circle(a => [c * Math.cos(a), s * Math.cos(a), Math.sin(a)]), "#c3cad2", 0.6);
    }
  }
}
