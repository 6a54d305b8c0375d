// A pen with the strokes and texts of a canvas that the map uses; what it draws is SVG.
"use strict";

class SvgPen {
  constructor(width, height) {
    const anchors = {center: "middle", right: "end", left: "start"};
    Object.assign(this, {width, height, anchors, parts: [], path: [], moves: [""], canvas: {clientWidth: width}, textAlign: "left"});
    this.measure = document.createElement("canvas").getContext("2d");
  }

  add(kind, attributes, text = "") {
    const safe = value => String(value).replace(/[<>&"]/g, letter => `&#${letter.charCodeAt(0)};`);
    const move = this.moves[this.moves.length - 1], all = move ? {...attributes, transform: move} : attributes;
    this.parts.push(`<${kind} ${Object.entries(all).map(([name, value]) => `${name}="${safe(value)}"`).join(" ")}>${safe(text)}</${kind}>`);
  }

  measureText(text) { this.measure.font = this.font; return this.measure.measureText(text); }
  save() { this.moves.push(this.moves[this.moves.length - 1]); }
  restore() { this.moves.pop(); }
  moved(text) { this.moves[this.moves.length - 1] += text; }
  translate(x, y) { this.moved(`translate(${x} ${y}) `); }
  rotate(angle) { this.moved(`rotate(${angle * 180 / Math.PI}) `); }
  beginPath() { this.path = []; }
  moveTo(x, y) { this.path.push(`M${x.toFixed(2)} ${y.toFixed(2)}`); }
  lineTo(x, y) { this.path.push(`${this.path.length ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`); }
  arc(x, y, r) { this.path.push(`M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`); }
  stroke() { this.add("path", {d: this.path.join(""), fill: "none", stroke: this.strokeStyle, "stroke-width": this.lineWidth ?? 1}); }
  fill() { this.add("path", {d: this.path.join(""), fill: this.fillStyle}); }
  strokeRect(x, y, width, height) { this.add("rect", {x, y, width, height, fill: "none", stroke: this.strokeStyle}); }
  drawImage(picture, x, y, width, height) { this.add("image", {href: picture.toDataURL(), x, y, width, height}); }

  text(text, x, y, paint) {
    const look = {"font-size": 13, "font-family": "system-ui, sans-serif", "dominant-baseline": "central"};
    this.add("text", {x, y, "text-anchor": this.anchors[this.textAlign], ...look, ...paint}, text);
  }

  fillText(text, x, y) { this.text(text, x, y, {fill: this.fillStyle}); }
  strokeText(text, x, y) { this.text(text, x, y, {fill: "none", stroke: this.strokeStyle, "stroke-width": this.lineWidth ?? 1}); }

  svg() {
    const size = `width="${this.width}" height="${this.height}" viewBox="0 0 ${this.width} ${this.height}"`;
    return `<svg xmlns="http://www.w3.org/2000/svg" ${size}><rect width="100%" height="100%" fill="white"/>${this.parts.join("")}</svg>`;
  }
}
