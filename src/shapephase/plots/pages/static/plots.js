// Curves in time beside a clock: a line marks its time, a dot and a number each curve's value; a pointer moves it.
"use strict";

const SVG = "http://www.w3.org/2000/svg";
// Colours and dashes, so that nothing is lost in black and white.
const CURVES = [
  ["#0072b2", ""], ["#d55e00", "7 3"], ["#009e73", "9 3 2 3"], ["#000000", "2 2"], ["#e69f00", "10 6"],
  ["#cc79a7", "4 2 2 2 2 2"], ["#56b4e9", "1 3"], ["#7f7f7f", "12 3 3 3"],
];
// Of a plot in its own pixels: all of it, and the margins left, right, above, below.
const SIZE = [460, 206];
const MARGINS = [52, 10, 8, 40];

// Letters of a name beside a curve: a longer one is without its middle, and whole under the pointer.
const LONGEST_NAME = 34;

function shortName(name) {
  const half = Math.floor(0.5 * (LONGEST_NAME - 1));
  return name.length > LONGEST_NAME ? `${name.slice(0, half)}…${name.slice(-half)}` : name;
}

function drawn(parent, kind, attributes) {
  const made = parent.appendChild(document.createElementNS(SVG, kind));
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

// Round numbers that cover a range.
function ticks(low, high, most = 5) {
  const rough = (high - low) / most, decade = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map(k => k * decade).find(k => k >= rough);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

class TimePlot {
  // `plot`: title, unit, and series of {name, values}, one value for each frame of the clock.
  constructor(holder, plot, clock) {
    this.plot = plot;
    this.clock = clock;
    const figure = holder.appendChild(element("figure", {className: "plot"}));
    this.legend = figure.appendChild(element("figcaption"));
    this.legend.append(element("b", {textContent: `${plot.title} [${plot.unit}]`}));
    this.svg = figure.appendChild(document.createElementNS(SVG, "svg"));
    this.svg.setAttribute("viewBox", `0 0 ${SIZE[0]} ${SIZE[1]}`);
    this.svg.setAttribute("role", "img");
    this.svg.setAttribute("aria-label", plot.title);
    this.scales();
    this.frame();
    this.shown = plot.series.map((series, k) => this.curve(series, k));
    this.line = drawn(this.svg, "line", {y1: MARGINS[2], y2: SIZE[1] - MARGINS[3], stroke: "#555", "stroke-width": 1});
    this.svg.addEventListener("pointerdown", event => this.point(event));
    this.svg.addEventListener("pointermove", event => { if (event.buttons) this.point(event); });
    clock.onChange(() => this.mark());
  }

  scales() {
    let [low, high] = [0, 0];
    for (const {values} of this.plot.series) {
      for (const value of values) { low = Math.min(low, value); high = Math.max(high, value); }
    }
    if (high - low < 1e-9) [low, high] = [low - 1, high + 1];
    // Digits of a value beside a name: three of the range, and one at least.
    this.digits = Math.min(6, Math.max(1, 2 - Math.floor(Math.log10(high - low))));
    const room = 0.04 * (high - low);
    [this.low, this.high] = [low - room, high + room];
    this.x = t => MARGINS[0] + (SIZE[0] - MARGINS[0] - MARGINS[1]) * t / this.clock.duration;
    this.y = v => MARGINS[2] + (SIZE[1] - MARGINS[2] - MARGINS[3]) * (this.high - v) / (this.high - this.low);
  }

  frame() {
    const [left, right, top, bottom] = [MARGINS[0], SIZE[0] - MARGINS[1], MARGINS[2], SIZE[1] - MARGINS[3]];
    const number = value => typeset(Number(value.toPrecision(6)));
    for (const value of ticks(this.low, this.high)) {
      drawn(this.svg, "line", {x1: left, x2: right, y1: this.y(value), y2: this.y(value), stroke: value ? "#e4e4e4" : "#aaa"});
      drawn(this.svg, "text", {x: left - 5, y: this.y(value) + 4, "text-anchor": "end"}).textContent = number(value);
    }
    for (const value of ticks(0, this.clock.duration)) {
      drawn(this.svg, "line", {x1: this.x(value), x2: this.x(value), y1: bottom, y2: bottom + 4, stroke: "#888"});
      drawn(this.svg, "text", {x: this.x(value), y: bottom + 17, "text-anchor": "middle"}).textContent = number(value);
    }
    drawn(this.svg, "text", {x: 0.5 * (left + right), y: bottom + 33, "text-anchor": "middle"}).textContent = "time [s]";
    drawn(this.svg, "rect", {x: left, y: top, width: right - left, height: bottom - top, fill: "none", stroke: "#888"});
  }

  curve({name, values}, k) {
    const [colour, dashes] = CURVES[k % CURVES.length];
    const width = this.clock.duration / (values.length - 1);
    const points = Array.from(values, (value, n) => `${this.x(n * width).toFixed(1)},${this.y(value).toFixed(1)}`);
    drawn(this.svg, "polyline", {points: points.join(" "), fill: "none", stroke: colour, "stroke-width": 1.7,
      "stroke-dasharray": dashes});
    const dot = drawn(this.svg, "circle", {r: 3.4, fill: colour, stroke: "white"});
    const key = element("span", {className: "key", title: name});
    const line = {x1: 0, x2: 32, y1: 5, y2: 5, stroke: colour, "stroke-width": 2, "stroke-dasharray": dashes};
    drawn(drawn(key, "svg", {viewBox: "0 0 32 10", "aria-hidden": "true"}), "line", line);
    const value = element("output");
    key.append(`${shortName(name)} `, value);
    this.legend.append(key);
    return {dot, value, values};
  }

  mark() {
    const {frame, share} = this.clock.place();
    const x = this.x(this.clock.time);
    this.line.setAttribute("x1", x);
    this.line.setAttribute("x2", x);
    this.current = this.shown.map(({dot, value, values}) => {
      const now = values[frame] + share * (values[frame + 1] - values[frame]);
      dot.setAttribute("cx", x);
      dot.setAttribute("cy", this.y(now));
      const scale = 10 ** this.digits;
      value.textContent = typeset((Math.round(now * scale) / scale + 0).toFixed(this.digits));
      return now;
    });
  }

  point(event) {
    const box = this.svg.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width * SIZE[0];
    this.clock.playing = false;
    this.clock.show((x - MARGINS[0]) / (SIZE[0] - MARGINS[0] - MARGINS[1]) * this.clock.duration);
  }
}
