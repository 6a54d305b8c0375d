"""Forward kinematics of a URDF in plain NumPy: mass, inertia, momentum and energy summed over the links of its XML."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
from scipy.spatial.transform import Rotation


class UrdfLinks:
    """A URDF as a list of links with forward kinematics; complex coordinates give exact derivatives."""

    def __init__(self, path):
        self.path = path
        root = ElementTree.fromstring(path.read_text(encoding="utf-8-sig"))
        self.links = {element.get("name"): self._inertial(element) for element in root.findall("link")}
        self.joints, children = [], set()
        for element in root.findall("joint"):
            axis = element.find("axis")
            axis = np.array([1.0, 0, 0]) if axis is None else self._numbers(axis.get("xyz") or "1 0 0")
            mimic = element.find("mimic")
            self.joints.append(
                {
                    "name": element.get("name"),
                    "kind": element.get("type"),
                    "parent": element.find("parent").get("link"),
                    "child": element.find("child").get("link"),
                    "origin": self._origin(element.find("origin")),
                    "axis": axis / (np.linalg.norm(axis) or 1.0),
                    "mimic": None
                    if mimic is None
                    else (mimic.get("joint"), float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))),
                }
            )
            children.add(element.find("child").get("link"))
        (self.root,) = set(self.links) - children

    @staticmethod
    def _numbers(text):
        return np.array([float(x) for x in text.split()])

    def _origin(self, element):
        if element is None:
            return np.eye(3), np.zeros(3)
        rpy = self._numbers(element.get("rpy") or "0 0 0")
        return Rotation.from_euler("xyz", rpy).as_matrix(), self._numbers(element.get("xyz") or "0 0 0")

    def _inertial(self, link_element):
        element = link_element.find("inertial")
        if element is None:
            return 0.0, np.zeros(3), np.zeros((3, 3))
        turn, centre = self._origin(element.find("origin"))
        i = {key: float(value) for key, value in element.find("inertia").items()}
        tensor = np.array(
            [[i["ixx"], i["ixy"], i["ixz"]], [i["ixy"], i["iyy"], i["iyz"]], [i["ixz"], i["iyz"], i["izz"]]]
        )
        return float(element.find("mass").get("value")), centre, turn @ tensor @ turn.T

    def motion(self, shape, rate):
        """Poses and twists of all links for joint coordinates and rates by name; the base at rest at the origin."""
        state = {self.root: (np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3))}
        todo = list(self.joints)
        while todo:
            ready = [j for j in todo if j["parent"] in state]
            todo = [j for j in todo if j["parent"] not in state]
            for j in ready:
                turn, place, spin, speed = state[j["parent"]]
                local, offset = j["origin"]
                here, at = turn @ local, place + turn @ offset
                speed = speed + np.cross(spin, at - place)
                x, v = self.coordinate(j, shape, rate)
                axis = here @ j["axis"]
                if j["kind"] == "prismatic":
                    state[j["child"]] = (here, at + x * axis, spin, speed + v * axis + np.cross(spin, x * axis))
                else:
                    k = np.cross(np.eye(3), j["axis"])  # hat of the axis
                    turned = here @ (np.eye(3) + np.sin(x) * k + (1.0 - np.cos(x)) * k @ k)
                    state[j["child"]] = (turned, at, spin + v * axis, speed)
        return state

    def coordinate(self, j, shape, rate):
        """Of a joint, and its rate; of one that follows, by way of its leader's."""
        if j["kind"] == "fixed":
            return 0.0, 0.0
        if j["mimic"] is None:
            return shape.get(j["name"], 0.0), rate.get(j["name"], 0.0)
        leader, multiplier, offset = j["mimic"]
        place, speed = self.coordinate(next(other for other in self.joints if other["name"] == leader), shape, rate)
        return multiplier * place + offset, multiplier * speed

    def masses(self):
        return np.array([m for m, _, _ in self.links.values()])

    def totals(self, shape, rate):
        """Centre of mass, I and L_o about it, kinetic energy about it, base axes."""
        parts = []
        state = self.motion(shape, rate)
        for name, (mass, centre, tensor) in self.links.items():
            turn, place, spin, speed = state[name]
            arm = turn @ centre
            parts.append((mass, place + arm, speed + np.cross(spin, arm), turn @ tensor @ turn.T, spin))
        whole = sum(p[0] for p in parts)
        middle = sum(p[0] * p[1] for p in parts) / whole
        drift = sum(p[0] * p[2] for p in parts) / whole
        inertia, momentum, energy = 0.0, 0.0, 0.0
        for mass, place, speed, tensor, spin in parts:
            d, u = place - middle, speed - drift
            inertia = inertia + tensor + mass * ((d @ d) * np.eye(3) - np.outer(d, d))
            momentum = momentum + tensor @ spin + mass * np.cross(d, u)
            energy = energy + 0.5 * mass * (u @ u) + 0.5 * spin @ tensor @ spin
        return middle, inertia, momentum, energy

    def particles(self, shape, rate):
        """Six masses a link with the link's own second moment: masses, places, speeds about the whole's centre."""
        masses, places, speeds = [], [], []
        state = self.motion(shape, rate)
        for name, (mass, centre, tensor) in self.links.items():
            if mass == 0.0:
                continue
            squares, axes = np.linalg.eigh(0.5 * np.trace(tensor) * np.eye(3) - tensor)
            arms = axes * np.sqrt(np.maximum(3.0 * squares / mass, 0.0))
            turn, place, spin, speed = state[name]
            for arm in np.concatenate([arms.T, -arms.T]):
                from_link = turn @ (centre + arm)
                masses.append(mass / 6.0)
                places.append(place + from_link)
                speeds.append(speed + np.cross(spin, from_link))
        masses, places, speeds = map(np.array, (masses, places, speeds))
        share = masses / masses.sum()
        return masses, places - share @ places, speeds - share @ speeds
