// The body with its axes, arrow, ghost, trail and centre of mass, in a Scene3D.
"use strict";

// Colours of Okabe and Ito, from 0 to 1: people with any colour vision can tell them apart, also in grey.
const VERMILION = [0.835, 0.369, 0, 1];
const AXIS_COLOURS = [[0.8, 0.475, 0.655, 1], [0, 0.62, 0.451, 1], [0, 0.447, 0.698, 1]];
const GHOST_COLOUR = [0.45, 0.47, 0.5, 0.22];
const CENTRE_COLOUR = [0.1, 0.1, 0.1, 1];
// Lengths of arrows over the reach of the body.
const MOMENTUM_LENGTH = 1;
const AXES_LENGTH = 0.5;
// The inertial axes stand in the corner: their length and their distance from the edges [px].
const CORNER_LENGTH = 28;
const CORNER_PLACE = 48;
// From this way of the centre of mass on, over the reach of the body, the camera goes with it unless told otherwise.
const FAR = 6;

class Figure3D {
  constructor(scene, data) {
    this.scene = scene;
    this.data = data;
    this.byHand = null;
    this.bodyFrame = false;
    const start = Array.from(row(data.centre, 0, 3));
    const ways = Array.from({length: data.centre.length / 3}, (_, k) => norm(plus(row(data.centre, k, 3), start, -1)));
    this.start = start;
    this.way = ways.reduce((most, way) => Math.max(most, way), 0) / data.reach;
    this.travels = this.way > 0.1;
    this.follows = this.way > FAR;
    this.groups = {body: [], ghost: [], "base axes": [], momentum: [], "centre of mass": [], floor: []};
    this.hidden = new Set();
    scene.up = data.up;
    const arrow = scene.upload(arrowMesh(0.014, 0.13, 0.036));
    const thin = scene.upload(arrowMesh(0.02, 0.14, 0.055));
    this.nodes = data.nodes.map(node => this.solidsOf(node, null));
    this.ghosts = data.ghost ? data.nodes.map(node => this.solidsOf(node, GHOST_COLOUR)) : [];
    this.axes = AXIS_COLOURS.map(colour => this.into("base axes", scene.add(thin, colour)));
    this.magnitude = norm(data.momentum);
    // Under a torque the arrow is as long as the momentum is large.
    const sizes = data.momenta ? Array.from({length: data.momenta.length / 3}, (_, k) => norm(row(data.momenta, k, 3))) : [];
    this.largest = sizes.reduce((most, size) => Math.max(most, size), 0);
    if (this.magnitude || data.momentum_changes) this.momentum = this.into("momentum", scene.add(arrow, VERMILION));
    this.centre = this.into("centre of mass", scene.add(scene.upload(sphereMesh(0.022 * data.reach)), CENTRE_COLOUR));
    if (data.floor) this.into("floor", scene.add(scene.upload({positions: data.floor}, true), [0.78, 0.78, 0.78, 1]));
    scene.drawOver.push((pen, where) => this.drawOver(pen, where));
    this.placeGhosts();
  }

  into(group, solid) {
    this.groups[group].push(solid);
    return solid;
  }

  solidsOf(node, colour) {
    const group = colour ? "ghost" : "body";
    return node.shapes.map(shape => {
      shape.uploaded ??= this.scene.upload(meshOf(shape, this.data.meshes));
      const rest = product(Array.from(shape.pose), shape.kind === "ellipsoid" ? scaled(...shape.dimensions) : IDENTITY);
      const solid = this.into(group, this.scene.add(shape.uploaded, colour ?? shape.colour));
      return {solid, rest};
    });
  }

  // Parts of the scene that there are, for a legend.
  shownGroups() {
    const found = Object.keys(this.groups).filter(name => this.groups[name].length && name !== "body");
    found.push("inertial axes");
    if (this.data.trail) found.push("trail");
    return found;
  }

  toggle(group, visible) {
    if (visible) this.hidden.delete(group); else this.hidden.add(group);
    for (const solid of this.groups[group] ?? []) solid.visible = visible && (group !== "momentum" || this.magnitude > 0);
    this.scene.invalidate();
  }

  // Another momentum; none is no arrow.
  pointAlong(momentum) {
    this.data.momentum = momentum;
    this.magnitude = norm(momentum);
    this.momentum.visible = this.magnitude > 0 && !this.hidden.has("momentum");
  }

  shapeAt({frame, share}) {
    const width = this.data.joints.length;
    const [a, b] = [row(this.data.shapes, frame, width), row(this.data.shapes, frame + 1, width)];
    return Array.from(a, (value, k) => value + share * (b[k] - value));
  }

  baseAt({frame, share}) {
    const turn = slerp(row(this.data.turns, frame, 4), row(this.data.turns, frame + 1, 4), share);
    return poseOfQuaternion(turn, this.between(this.data.places, {frame, share}));
  }

  between(array, {frame, share}) {
    const [a, b] = [row(array, frame, 3), row(array, frame + 1, 3)];
    return plus(times(a, 1 - share), b, share);
  }

  // Poses of the nodes in base axes.
  nodePoses(place, shape) {
    if (this.data.chain) {
      const poses = framePoses(this.data.chain, shape);
      return this.data.nodes.map(node => poses[node.frame]);
    }
    return this.data.nodes.map(node => {
      const turn = slerp(row(node.turns, place.frame, 4), row(node.turns, place.frame + 1, 4), place.share);
      const pose = poseOfQuaternion(turn, this.between(node.places, place));
      return node.scales ? product(pose, scaled(...this.between(node.scales, place))) : pose;
    });
  }

  show(place) {
    this.place = place;
    this.base = this.baseAt(place);
    if (this.data.momenta) this.pointAlong(this.between(this.data.momenta, place));
    let centre = this.between(this.data.centre, place);
    let shape = null;
    if (this.data.chain) {
      shape = this.byHand ?? this.shapeAt(place);
      // Moved by hand, the body keeps its attitude and its centre of mass.
      if (this.byHand) {
        const inBase = centreOfMass(this.data.chain, framePoses(this.data.chain, shape));
        const off = plus(centre, moved(this.base, inBase), -1);
        this.base = [...this.base.slice(0, 12), ...plus(placeOf(this.base), off), 1];
      }
    }
    this.pose(this.base, this.nodePoses(place, shape), centre);
  }

  // Draw the body with its base and nodes at these poses, about a centre of mass.
  pose(base, nodes, centre) {
    this.base = base;
    this.nodes.forEach((solids, k) => {
      for (const {solid, rest} of solids) solid.pose = product(base, product(nodes[k], rest));
    });
    const length = AXES_LENGTH * this.data.reach;
    this.centrePlace = centre;
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, k) => {
      const size = scaled(length, length, length);
      this.axes[k].pose = product(poseAlong(turned(base, axis), placeOf(base)), size);
    });
    if (this.momentum && this.magnitude) {
      const long = this.arrowLength();
      this.momentum.pose = product(poseAlong(this.data.momentum, centre), scaled(long, long, long));
    }
    this.centre.pose = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...centre, 1];
    this.scene.world = IDENTITY;
    if (this.bodyFrame) {
      const still = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...this.scene.camera.target, 1];
      const riding = [...base.slice(0, 12), ...centre, 1];
      this.scene.world = product(still, inverse(riding));
    } else if (this.follows) {
      this.scene.world = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...plus(this.start, centre, -1), 1];
    }
    this.scene.invalidate();
  }

  // Of the momentum: some pages need a longer one than others, to be seen.
  arrowLength() {
    return (this.data.arrow ?? MOMENTUM_LENGTH) * this.data.reach * (this.largest ? this.magnitude / this.largest : 1);
  }

  placeGhosts() {
    const start = {frame: 0, share: 0};
    const base = this.baseAt(start);
    const nodes = this.nodePoses(start, this.data.chain ? this.shapeAt(start) : null);
    this.ghosts.forEach((solids, k) => {
      for (const {solid, rest} of solids) solid.pose = product(base, product(nodes[k], rest));
    });
  }

  drawOver(pen, where) {
    if (!this.base) return;
    const reach = this.data.reach;
    if (!this.hidden.has("trail") && this.data.trail) this.drawTrail(pen, where);
    ["x", "y", "z"].forEach((letter, k) => {
      const axis = [0, 1, 2].map(n => Number(n === k));
      if (!this.hidden.has("base axes")) {
        const tip = plus(placeOf(this.base), turned(this.base, axis), 1.12 * AXES_LENGTH * reach);
        label(pen, where(tip), letter, `rgb(${AXIS_COLOURS[k].slice(0, 3).map(c => 190 * c)})`);
      }
    });
    if (!this.hidden.has("inertial axes")) this.drawInertialAxes(pen);
    if (this.magnitude && !this.hidden.has("momentum")) {
      const tip = plus(this.centrePlace, unit(this.data.momentum), this.arrowLength());
      labelBeyond(pen, where(this.centrePlace), where(tip), `${Number(this.magnitude.toPrecision(3))} kg m²/s`, "#a04400");
    }
  }

  // Where the axes of space point, X Y Z.
  drawInertialAxes(pen) {
    const height = this.scene.holder.clientHeight;
    const turn = product(this.scene.seen, this.scene.world);
    const axes = ["X", "Y", "Z"].map((letter, k) => [letter, turned(turn, [0, 1, 2].map(n => Number(n === k)))]);
    axes.sort((a, b) => a[1][2] - b[1][2]);
    pen.lineWidth = 2.5;
    for (const [letter, [x, y, z]] of axes) {
      const shade = z > -0.2 ? "#555" : "#aaa";
      const tip = factor => [CORNER_PLACE + factor * CORNER_LENGTH * x, height - CORNER_PLACE - factor * CORNER_LENGTH * y];
      pen.strokeStyle = shade;
      pen.beginPath();
      pen.moveTo(...tip(0));
      pen.lineTo(...tip(1));
      pen.stroke();
      label(pen, tip(1.4), letter, shade);
    }
  }

  drawTrail(pen, where) {
    const count = this.data.trail.length / 3;
    const here = this.place.frame + this.place.share;
    pen.lineWidth = 2.5;
    for (let k = 0; k + 1 < count; k++) {
      const [a, b] = [where(row(this.data.trail, k, 3)), where(row(this.data.trail, k + 1, 3))];
      if (!a || !b) continue;
      const share = k / count;
      pen.strokeStyle = `rgba(${86 * (1 - share)}, ${180 - 120 * share}, ${233 - 123 * share}, ${k < here ? 1 : 0.35})`;
      pen.beginPath();
      pen.moveTo(...a);
      pen.lineTo(...b);
      pen.stroke();
    }
    const now = where(this.between(this.data.trail, this.place));
    if (now) {
      pen.fillStyle = "rgb(0, 114, 178)";
      pen.beginPath();
      pen.arc(...now, 5, 0, 2 * Math.PI);
      pen.fill();
    }
  }

  // Points that are to be seen at all times.
  extent() {
    if (this.follows) return this.around(this.start);
    const points = [];
    for (let k = 0; k < this.data.extent.length / 3; k++) points.push(Array.from(row(this.data.extent, k, 3)));
    for (const frame of [0, Math.floor(0.5 * this.data.frames) - 1, this.data.frames - 2]) {
      const base = this.baseAt({frame, share: 0});
      for (const axis of [[1, 0, 0], [0, 1, 0], [0, 0, 1]]) {
        points.push(moved(base, times(axis, 1.15 * AXES_LENGTH * this.data.reach)));
      }
    }
    if (this.magnitude) {
      const tip = times(unit(this.data.momentum), 1.12 * this.arrowLength());
      const count = this.data.centre.length / 3;
      for (const k of [0, count - 1]) points.push(plus(Array.from(row(this.data.centre, k, 3)), tip));
    }
    return points;
  }

  // All of the body and of its arrow about a centre of mass.
  around(centre) {
    const points = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].flatMap(axis => [1, -1].map(side => plus(centre, axis, side * this.data.reach)));
    if (this.magnitude) points.push(plus(centre, unit(this.data.momentum), 1.12 * MOMENTUM_LENGTH * this.data.reach));
    return points;
  }
}
