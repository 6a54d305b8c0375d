"""Published numbers beside those of the library: `python -m benchmarks.published` writes them into docs/published.md.

An entry has the number as it was printed, and a function that computes it by public names alone. It holds where the two
agree within half of the last printed digit, or within the uncertainty that was printed. `--check` writes nothing, and
ends with 1 where one does not hold.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapephase.rigid_body import geodesics

from . import published_cases as cases

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "published.md"
_BEGIN, _END = "<!-- results -->\n", "<!-- end of results -->\n"
_MORE_DIGITS = 2
"""That a computed number is shown with, beyond those printed."""
_NO_BREAK = "\N{NO-BREAK SPACE}"
"""Between a number and its unit: J s in two lines would be J/s."""
_SLACK = 1e-6
"""In parts of the last digit: a number that was rounded half up is not refused for the rounding of ours."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A published number.

    Attributes
    ----------
    topic : heading of the page
    what : it is
    source : key of docs/references.bib
    inputs : from which it is computed
    published : as it was printed, every digit
    unit : of it
    computed : by the library
    within : its printed uncertainty; None: half of its last digit
    truncated : whether its digits were cut off instead of rounded
    is_slow : whether it takes more than a tenth of a second
    """

    topic: str
    what: str
    source: str
    inputs: str
    published: str
    unit: str
    computed: Callable[[], float]
    within: float | None = None
    truncated: bool = False
    is_slow: bool = False

    @property
    def digits(self) -> int:
        """After the point."""
        return len(self.published.partition(".")[2])

    def holds(self, number: float) -> bool:
        """Whether a computed number is the published one."""
        last = 10.0**-self.digits
        difference = number - float(self.published)
        if self.truncated:
            return -_SLACK * last <= difference * np.sign(number) < last
        return abs(difference) <= (0.5 * last if self.within is None else self.within) + _SLACK * last


_TRANSFER = "Orbital transfer"
_CAT_INPUTS = "J = 0.0025, I = 0.01 kg m², 1 s, begins and ends straight"
_FLIPS = "A spacecraft that flips, or does not"
_CATS = "Cats of two halves"
_CLOCKS = "Two clocks of a tumbling body"
_HOLONOMIES = "The smallest holonomies"
_HALLEY = "long axis 66° from L, precession 3.69 d, roll 7.1 d"
_MORPHS = "I = (0.3, 0.35, 0.4) kg m², ω = (0.1, 15, 0.1) rad/s"


def entries() -> list[Entry]:
    """All of them."""
    return [*_bricks(), *_flips(), *_cats(), *_clocks(), *_transfers(), *_holonomies()]


def _bricks() -> list[Entry]:
    printed = {"x": "12.6183908", "y": "-17.3974748", "z": "31.1195889"}
    return [
        Entry(
            topic="A tumbling brick",
            what=f"rate about {axis} after 30 s",
            source="nasa2015",
            inputs="I = (0.001894220, 0.006211019, 0.007194665) slug ft², rates 10, 20, 30 °/s",
            published=number,
            unit="°/s",
            computed=lambda k=k: cases.brick_rate(k),
        )
        for k, (axis, number) in enumerate(printed.items())
    ]


def _flips() -> list[Entry]:
    period = cases.spacecraft().period
    spins = [
        ("turned over, I_yy to 0.2", "-26.25", 0.2, 0.0),
        ("turned over, I_yy to 0.5", "-10.5", 0.5, 0.0),
        ("turned back, I_yy to 0.2", "26.25", 0.2, 0.5 * period),
    ]
    radii = zip("xyz", ("0.3873", "0.2236", "0.3162"), strict=True)
    return [
        Entry(
            what="first inversion (printed 6.77)",
            inputs=_MORPHS,
            published="6.77",
            truncated=True,
            unit="s",
            computed=cases.inversion_time,
            topic=_FLIPS,
            source="trivailo2017",
        ),
        Entry(
            what="between inversions",
            inputs=_MORPHS,
            published="6.1675",
            unit="s",
            computed=lambda: 0.5 * cases.spacecraft().period,
            topic=_FLIPS,
            source="trivailo2017",
        ),
        *(
            Entry(
                what=f"spin, {what} within 0.2 s",
                inputs=_MORPHS,
                published=number,
                unit="rad/s",
                computed=lambda moment=moment, later=later: cases.morphed_spin(moment, cases.inversion_time() + later),
                topic=_FLIPS,
                source="trivailo2017",
            )
            for what, number, moment, later in spins
        ),
        *(
            Entry(
                what=f"radius of the masses on {axis}",
                inputs="six masses of 1 kg, I = (0.3, 0.5, 0.4) kg m²",
                published=number,
                unit="m",
                computed=lambda k=k: float(cases.mass_radii(np.array([0.3, 0.5, 0.4]))[k]),
                topic=_FLIPS,
                source="trivailo2017",
            )
            for k, (axis, number) in enumerate(radii)
        ),
    ]


def _cats() -> list[Entry]:
    costs = {45.0: "0.0164371741", 90.0: "0.0372037571", 180.0: "0.0904943497"}
    bends = [(0.0, "59.426459"), (20.0, "61.813873"), (45.0, "70.316222")]
    return [
        *(
            Entry(
                topic=_CATS,
                what=f"least kinetic cost of a turn by {degrees:.0f}°",
                source="montgomery1993",
                inputs=_CAT_INPUTS,
                published=number,
                unit="J s",
                computed=lambda degrees=degrees: cases.best_turn(degrees)[0],
                is_slow=True,
            )
            for degrees, number in costs.items()
        ),
        Entry(
            topic=_CATS,
            what="largest bend of the cheapest turn by 180°",
            source="montgomery1993",
            inputs=_CAT_INPUTS,
            published="83.244",
            unit="°",
            computed=lambda: cases.best_turn(180.0)[1],
            is_slow=True,
        ),
        Entry(
            topic=_CATS,
            what="cost of the circle of Kane and Scher, 180° too, never straight",
            source="kane1969",
            inputs="J = 0.0025, I = 0.01 kg m², 1 s, bend 59.43° throughout",
            published="0.0558364435",
            unit="J s",
            computed=cases.circle_cost,
        ),
        *(
            Entry(
                topic=_CATS,
                what=f"turn by the cone α = {alpha:.0f}°, β = {beta}°",
                source="kane1969",
                inputs="J/I = 0.25",
                published="180.0000",
                unit="°",
                computed=lambda alpha=alpha, beta=beta: cases.righting_turn(alpha, float(beta)),
            )
            for alpha, beta in bends
        ),
    ]


def _clocks() -> list[Entry]:
    return [
        Entry(
            what="Halley: time of a turn about ω",
            published="2.84",
            unit="d",
            computed=cases.halley_period,
            topic=_CLOCKS,
            source="belton1991",
            inputs=_HALLEY,
        ),
        Entry(
            what="Halley: ω from L",
            published="21.4",
            unit="°",
            computed=cases.halley_angle,
            topic=_CLOCKS,
            source="belton1991",
            inputs=_HALLEY,
        ),
        Entry(
            topic=_CLOCKS,
            what="Toutatis: third period, seen in its light curve",
            source="spencer1995",
            inputs="roll 5.41 d, precession 7.35 d {cite:p}`hudson1995`, moments 3.22 : 3.09 : 1",
            published="3.1",
            unit="d",
            computed=lambda: cases.third_clock(cases.tumbling(*cases.TOUTATIS)[0], 5.41),
        ),
        Entry(
            topic=_CLOCKS,
            source="pravec2014",
            what="Apophis: energy over that of the slowest spin",
            inputs="precession 27.38 h, roll 263 h, moments 0.61 : 0.965 : 1",
            published="1.024",
            within=0.013,
            unit="",
            computed=lambda: cases.tumbling(*cases.APOPHIS)[1],
        ),
        Entry(
            topic=_CLOCKS,
            what="Earth: days in which its axis goes round the pole, if it were rigid",
            source="goldstein2002",
            inputs="(I₃ − I₁)/I₁ = 0.00327",
            published="305.81",
            unit="d",
            computed=cases.euler_days,
        ),
        Entry(
            topic=_CLOCKS,
            what="Feynman's plate: wobbles in a spin, for a small tilt",
            source="chao1989",
            inputs="I = (1, 1, 2)",
            published="2.000000",
            unit="",
            computed=cases.plate_ratio,
        ),
    ]


def _transfers() -> list[Entry]:
    rows: list[tuple[str, str, str, Callable[[], float]]] = [
        ("period of p = 1, 2π/√(1 + λ)", "4.6832098207", "", lambda: float(cases.transfer_surface().period(1.0))),
        (
            "first return of p = 1, π (1 − λ/√(1 + λ))",
            "1.2683087253",
            "rad",
            lambda: float(cases.transfer_surface().first_return(1.0)),
        ),
        (
            "first conjugate point on the equator, π √(1 − λ)",
            "1.4049629462",
            "",
            lambda: float(geodesics.conjugate_points(cases.transfer_surface(), 0.0).time),
        ),
        (
            "cusps of the conjugate locus of a point of the equator",
            "4",
            "",
            lambda: float(geodesics.conjugate_locus(cases.transfer_surface(), 120).cusps),
        ),
        (
            "its cut locus, on the equator, from π/5",
            "0.6283185307",
            "rad",
            lambda: geodesics.cut_locus(cases.transfer_surface()).longitudes[0],
        ),
        ("to 9π/5", "5.6548667765", "rad", lambda: geodesics.cut_locus(cases.transfer_surface()).longitudes[1]),
        (
            "length up to which a meridian is shortest, π",
            "3.1415926536",
            "",
            lambda: float(geodesics.cut_time(cases.transfer_surface(), 0.5 * np.pi)),
        ),
    ]
    return [
        Entry(
            topic=_TRANSFER,
            what=what,
            source="bonnard2009",
            inputs="dφ² + sin²φ/(1 − λ sin²φ) dθ², λ = 4/5",
            published=number,
            unit=unit,
            computed=computed,
        )
        for what, number, unit, computed in rows
    ]


def _holonomies() -> list[Entry]:
    return [
        Entry(
            topic=_HOLONOMIES,
            what="Foucault's pendulum in Paris: degrees an hour",
            source="foucault1851",
            inputs="48° 50′ 46″ N, a day of 23 h 56 min 4.09 s",
            published="11.3",
            unit="°/h",
            computed=cases.foucault_rate,
        ),
        Entry(
            topic=_HOLONOMIES,
            what="Foucault's pendulum in Paris: a whole turn",
            source="foucault1851",
            inputs="48° 50′ 46″ N",
            published="31.8",
            unit="h",
            computed=lambda: 360.0 / cases.foucault_rate(),
        ),
        Entry(
            topic=_HOLONOMIES,
            what="Levi's bicycle wheel, its axle round an octant of the sphere: the area, π/2",
            source="levi1994",
            inputs="three quarters of great circles",
            published="90.000000",
            unit="°",
            computed=cases.bicycle_wheel,
        ),
        *(
            Entry(
                topic=_HOLONOMIES,
                what="an ant walks once round the rim of a free disc: −2π · 2m/(M + 3m)",
                source="usapho2021",
                inputs=f"disc {disc:.0f} times as heavy as the ant",
                published=number,
                unit="°",
                computed=lambda disc=disc: cases.ant_on_a_disc(disc),
            )
            for disc, number in ((3.0, "-120.000000"), (5.0, "-90.000000"))
        ),
        Entry(
            topic=_HOLONOMIES,
            what="the largest turn of a linked pentagon in one round",
            source="tong2012",
            inputs="five equal masses and edges",
            published="28.15937237",
            unit="°",
            computed=cases.pentagon_turn,
            is_slow=True,
        ),
    ]


def table(found: list[tuple[Entry, float]]) -> str:
    """The results as the page has them: under a heading for each topic a table for each of its inputs and sources."""
    lines: list[str] = []
    topic = group = None
    for entry, number in found:
        if entry.topic != topic:
            lines += [*([""] if lines else []), f"## {entry.topic}"]
        if (entry.topic, entry.inputs, entry.source) != group:
            lines += [
                "",
                said_of(entry),
                "",
                "| what | published | computed | difference |",
                "|---|---|---|---|",
            ]
        lines.append(_row(entry, number))
        topic, group = entry.topic, (entry.topic, entry.inputs, entry.source)
    return "\n".join(lines) + "\n"


def said_of(entry: Entry) -> str:
    """Where a number is from, and what it is computed from."""
    return f"{{cite:t}}`{entry.source}`, from {entry.inputs}:"


def _row(entry: Entry, number: float) -> str:
    shown = f"{number:.{entry.digits + _MORE_DIGITS}f}" if entry.digits else f"{number:.0f}"
    printed = entry.published + (f" ± {entry.within}" if entry.within else "…" if entry.truncated else "")
    gap = "" if entry.unit.startswith("°") else " "
    difference = f"{number - float(entry.published):z.{entry.digits + 1}f}" if entry.digits else "0"
    quantities = [f"{value}{gap}{entry.unit}".strip().replace(" ", _NO_BREAK) for value in (printed, shown)]
    cells = (entry.what, *quantities, difference)
    return f"| {' | '.join(cells)} |"


def with_results(page: str, results: str) -> str:
    """The page with the results between its two marks."""
    before, _, rest = page.partition(_BEGIN)
    _, _, after = rest.partition(_END)
    return f"{before}{_BEGIN}{results}{_END}{after}"


def main() -> int:
    """Compute all of them; write the page, or only say which do not hold."""
    found = [(entry, entry.computed()) for entry in entries()]
    wrong = [(entry, number) for entry, number in found if not entry.holds(number)]
    for entry, number in wrong:
        print(f"{entry.topic}: {entry.what}: published {entry.published}, computed {number!r}")
    print(f"{len(found) - len(wrong)} of {len(found)} published numbers")
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(with_results(PAGE.read_text(encoding="utf-8"), table(found)), encoding="utf-8")
        print(f"wrote {PAGE.relative_to(ROOT)}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
