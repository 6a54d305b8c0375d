"""Draws cat_righting.svg, the picture of the README, from the computed motion.

Run as `python notebooks/readme_picture.py`. Every link is drawn from the primitives of the URDF, far ones first.
"""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.body.catalog import robots_folder
from shapephase.examples.scenarios import MOTIONS, cat_righting

FRAMES = 7
SCALE = 330.0
SPACING = 0.42
SIDEWAYS, DOWN = np.array([-0.62, 0.78, 0.0]), np.array([-0.18, -0.14, -0.97])
TOWARDS = np.cross(SIDEWAYS, -DOWN)
COLOURS = {"trunk": "#d08a3e", "head": "#c27a2e", "tail": "#a8662a", "front": "#b9722f", "rear": "#b9722f"}


def primitives():
    """Link, endpoints in the link's axes, radius, for every cylinder and sphere of the cat."""
    robot = ElementTree.parse(robots_folder() / "cat.urdf").getroot()
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            origin = visual.find("origin")
            attributes = {} if origin is None else origin.attrib
            centre = np.array(attributes.get("xyz", "0 0 0").split(), float)
            turn = Rotation.from_euler("xyz", np.array(attributes.get("rpy", "0 0 0").split(), float)).as_matrix()
            geometry = visual.find("geometry")[0]
            if geometry.tag == "box":
                half, radius = np.zeros(3), 0.4 * max(map(float, geometry.get("size").split()))
            else:
                radius = float(geometry.get("radius"))
                half = 0.5 * turn @ [0.0, 0.0, max(float(geometry.get("length", 0.0)) - 2.0 * radius, 0.0)]
            yield link.get("name"), centre - half, centre + half, radius


def main():
    """Compute, draw, write."""
    body, path = sp.load_body("cat"), cat_righting()
    on_its_back = so3.matrix_from_quat(np.array(MOTIONS["cat_righting"].attitude))
    motion = sp.reconstruct(sp.articulated(body, path), np.zeros(3), on_its_back)
    # Postures evenly spaced in the bend's own course, which is slow at both ends.
    times = path.duration * (0.5 + 0.19 * np.linspace(-1.0, 1.0, FRAMES - 2))
    times = np.concatenate([[0.0], times, [path.duration]])
    shapes = []
    for column, t in enumerate(times):
        shift = np.array([column * SPACING, 0.0])
        attitude, base = motion.attitude(t), motion.base_position(t)
        for link, a, b, radius in primitives():
            pose = body.link_pose(path.shape(t), link)
            ends = [attitude @ (pose[:3, :3] @ point + pose[:3, 3]) + base for point in (a, b)]
            flat = [SCALE * (np.array([end @ SIDEWAYS, end @ DOWN]) + shift) for end in ends]
            depth = 0.5 * (ends[0] + ends[1]) @ TOWARDS
            colour = COLOURS[link.split("_")[0]]
            shapes.append((column, depth, flat, 2.0 * radius * SCALE, colour))
    lines = []
    for _, _, ((x1, y1), (x2, y2)), width, colour in sorted(shapes, key=lambda s: s[:2]):
        for stroke, extra in (("#3d2814", 2.4), (colour, 0.0)):
            lines.append(
                f'<path d="M{x1:.1f} {y1:.1f}L{x2 + 0.1:.1f} {y2:.1f}" stroke="{stroke}" '
                f'stroke-width="{width + extra:.1f}"/>'
            )
    left, width, height = -0.26 * SCALE, (FRAMES - 1) * SPACING * SCALE + 0.6 * SCALE, 0.62 * SCALE
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left:.0f} {-0.5 * height:.0f} {width:.0f} {height:.0f}">'
        f'<rect x="{left:.0f}" y="{-0.5 * height:.0f}" width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>'
        f'<g fill="none" stroke-linecap="round">\n' + "\n".join(lines) + "\n</g></svg>\n"
    )
    (Path(__file__).parent / "cat_righting.svg").write_text(text)


if __name__ == "__main__":
    main()
