// Where the parts of a body are in its shapes: `chain` is what Python knows as JointChain.
"use strict";

// Coordinates of all joints, those that follow others included.
function jointCoordinates(chain, shape) {
  const width = shape.length;
  const found = Array.from(chain.offset, (offset, k) => {
    let sum = offset;
    for (let n = 0; n < width; n++) sum += chain.matrix[k * width + n] * shape[n];
    return sum;
  });
  // Each stands behind those that it follows.
  for (const joint of chain.curved) {
    found[joint.row] = joint.start;
    for (const term of joint.terms) found[joint.row] += followed(term, found[term.source]);
  }
  return found;
}

// A function of a coordinate that is a polynomial between any two knots.
function followed(term, coordinate) {
  const behind = term.knots.findIndex((knot) => coordinate < knot);
  const piece = behind < 0 ? term.knots.length : behind;
  const since = coordinate - term.centres[piece];
  return term.coefficients[piece].reduceRight((value, coefficient) => value * since + coefficient, 0);
}

// Of the four numbers of a ball joint, whatever their length.
function ballTurn(shape, column) {
  const four = [0, 1, 2, 3].map(k => shape[column + k]), length = Math.hypot(...four);
  return poseOfQuaternion(length > 0 ? four.map(value => value / length) : [0, 0, 0, 1], [0, 0, 0]);
}

// Of the base and of what each joint moves, in base axes.
function framePoses(chain, shape) {
  const poses = [IDENTITY];
  jointCoordinates(chain, shape).forEach((q, k) => {
    const slide = times(row(chain.slides, k, 3), q);
    const ball = chain.balls.find(one => one.row === k);
    const fixed = poseOfRows(row(chain.turns, k, 9), row(chain.places, k, 3));
    const rest = ball ? product(fixed, ballTurn(shape, ball.column)) : fixed;
    const motion = poseOfTurn(row(chain.axes, k, 3), q, slide);
    poses.push(product(poses[chain.parents[k]], product(rest, motion)));
  });
  return poses;
}

// In base axes.
function centreOfMass(chain, poses) {
  let sum = [0, 0, 0], mass = 0;
  poses.forEach((pose, k) => {
    sum = plus(sum, moved(pose, row(chain.centres, k, 3)), chain.masses[k]);
    mass += chain.masses[k];
  });
  return times(sum, 1 / mass);
}
