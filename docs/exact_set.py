"""Draws docs/exact-set.svg: what the limits of rotor 1 allow, and the box around it.

    python3 docs/exact_set.py

Left, the plane of rotor 1 (u1, u2) in shares of Omega1max^2. Right, the same set as pitching and yawing moment with the
rear rotors at trim, inside the smallest box around the whole set. Numbers: the mixing matrix and the trim of
tests/reference/reference.json, and the limits of profile robust.
"""

import json
import math
from pathlib import Path

HERE = Path(__file__).parent
REFERENCE = json.loads((HERE.parent / "tests/reference/reference.json").read_text())["reference"]
M, TRIM = REFERENCE["M"], REFERENCE["trim"]["u"]
LIMIT = (2 * REFERENCE["trim"]["Om1"]) ** 2
IDLE = 200.0**2
TILT_MAX, TILT_TRIM = math.radians(60), REFERENCE["trim"]["mu"]


def front_set():
    """Returns the border of rotor 1's set in (u1, u2): the arc of highest speed, then back along the idle cut."""
    cut_meets_arc = TILT_TRIM - math.acos(IDLE / LIMIT)
    low, high = max(-TILT_MAX, cut_meets_arc), TILT_MAX
    arc = [polar(LIMIT, low + i * (high - low) / 60) for i in range(61)]
    return [*arc, polar(IDLE / math.cos(high - TILT_TRIM), high)]


def polar(radius, tilt):
    return radius * math.sin(tilt), radius * math.cos(tilt)


def moments(u1, u2):
    """Returns pitching and yawing moment [N m] as deviations from trim, with the rear rotors at trim."""
    du = [u1 - TRIM[0], u2 - TRIM[1], 0.0, 0.0]
    return tuple(sum(m * d for m, d in zip(M[row], du)) for row in (1, 3))


def extreme(row, sign):
    """Returns the largest (`sign` 1) or smallest (-1) conventional input over the whole set, as deviation from trim."""
    c = [sign * m for m in M[row]]
    front = max(c[0] * u1 + c[1] * u2 for u1, u2 in front_set())
    rear_limit = (2 * REFERENCE["trim"]["Om2"]) ** 2
    rear = sum(k * (rear_limit if k > 0 else IDLE) for k in c[2:])
    return sign * (front + rear) - sum(m * t for m, t in zip(M[row], TRIM))


class Panel:
    """Axes with a title, which map data to pixels."""

    def __init__(self, left, x_range, y_range, titles):
        self.left, self.x_range, self.y_range, self.out = left, x_range, y_range, []
        title, x_title, y_title = titles
        self.out.append(f'<rect class="frame" x="{left}" y="40" width="320" height="320"/>')
        self.text(left + 160, 16, title, "middle")
        self.text(left + 160, 394, x_title, "middle")
        self.text(left, 34, y_title, "start")
        for value in ticks(*x_range):
            self.text(self.x(value), 376, f"{value:g}", "middle")
        for value in ticks(*y_range):
            self.text(left - 6, self.y(value) + 4, f"{value:g}", "end")

    def x(self, value):
        low, high = self.x_range
        return self.left + 320 * (value - low) / (high - low)

    def y(self, value):
        low, high = self.y_range
        return 360 - 320 * (value - low) / (high - low)

    def text(self, x, y, words, anchor):
        self.out.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{words}</text>')

    def polygon(self, points, kind):
        path = " ".join(f"{self.x(px):.1f},{self.y(py):.1f}" for px, py in points)
        self.out.append(f'<polygon class="{kind}" points="{path}"/>')

    def dot(self, point, words):
        self.out.append(f'<circle class="dot" cx="{self.x(point[0]):.1f}" cy="{self.y(point[1]):.1f}" r="4"/>')
        self.text(self.x(point[0]) + 8, self.y(point[1]) + 4, words, "start")


def ticks(low, high):
    step = next(s for s in (0.5, 1, 2, 5, 10) if (high - low) / s <= 6)
    first = math.ceil(low / step)
    return [i * step for i in range(first, math.floor(high / step) + 1)]


def main():
    inside = front_set()
    left = Panel(60, (-1.2, 1.2), (-1.2, 1.2), ("rotor 1: disc, tilt wedge, idle cut", "u1 / max", "u2 / max"))
    left.polygon([polar(1.0, i * math.tau / 90) for i in range(90)], "circle")
    left.polygon([(u1 / LIMIT, u2 / LIMIT) for u1, u2 in inside], "set")
    left.dot((TRIM[0] / LIMIT, TRIM[1] / LIMIT), "hover")

    lon, ped = ([extreme(row, sign) for sign in (-1, 1)] for row in (1, 3))
    span = lambda low_high: (low_high[0] - 0.5, low_high[1] + 0.5)
    right = Panel(460, span(lon), span(ped), ("the same as moments, and the box", "lon [N m]", "ped [N m]"))
    right.polygon([(lon[i], ped[j]) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))], "box")
    right.polygon([moments(*point) for point in inside], "set")
    right.dot((0.0, 0.0), "hover")

    style = (
        "text{font:12px sans-serif;fill:#444} .frame{fill:none;stroke:#999} .set{fill:#3b7dd8;fill-opacity:.35;stroke:#3b7dd8}"
        " .box{fill:none;stroke:#c33;stroke-dasharray:6 4} .circle{fill:none;stroke:#999;stroke-dasharray:2 3} .dot{fill:#222}"
    )
    body = "\n".join(left.out + right.out)
    picture = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 810 410" role="img">\n<title>The exact actuator set</title>\n'
        f'<style>{style}</style>\n<rect width="810" height="410" fill="#fff"/>\n{body}\n</svg>\n'
    )
    (HERE / "exact-set.svg").write_text(picture)


if __name__ == "__main__":
    main()
