// One clock for all of a page: the time of the body [s].
"use strict";

// How long the end is shown before all begins again [s].
const AT_THE_END = 0.8;

class Clock {
  constructor(duration, frames, speed) {
    Object.assign(this, {duration, frames, speed, time: 0, playing: false, listeners: [], run: 0});
  }

  onChange(listener) {
    this.listeners.push(listener);
    listener(this);
  }

  changed() {
    for (const listener of this.listeners) listener(this);
  }

  show(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.changed();
  }

  // By whole frames, from the nearest one.
  step(count) {
    this.playing = false;
    const width = this.duration / (this.frames - 1);
    this.show((Math.round(this.time / width) + count) * width);
  }

  play(playing = !this.playing) {
    this.playing = playing;
    this.run += 1;
    this.changed();
    if (!playing) return;
    const mine = this.run;
    let last = performance.now(), waited = this.time >= this.duration ? AT_THE_END : 0;
    const tick = now => {
      if (!this.playing || this.run !== mine) return;
      const passed = Math.max(now - last, 0) / 1000;
      last = now;
      if (this.time < this.duration) this.show(this.time + passed * this.speed);
      else if ((waited += passed) > AT_THE_END) { waited = 0; this.show(0); }
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  // The frame before this time, and how far it is to the next.
  place() {
    return this.placeAt(this.time);
  }

  placeAt(time) {
    const at = Math.min(time / this.duration, 1) * (this.frames - 1);
    const frame = Math.min(Math.floor(at + 1e-9), this.frames - 2);
    return {frame, share: Math.min(Math.max(at - frame, 0), 1)};
  }
}
