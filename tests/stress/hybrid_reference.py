"""Trains that switch, solved by hand: an automaton of modes, scipy's integrator between its events. Nothing here comes from gearlib.

Between two events every friction element is free, stuck or slides in one sense, every gap is open or closed at one side, and
every controller is on or off. At an event the elements at rest are given the modes that agree with the accelerations they cause.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tests.stress.described import Part, Signal, Train
from tests.stress.linear_reference import LinearTrain, Unclear

Floats = NDArray[np.float64]
AT_REST = 1e-9  # rad/s
MOST_EVENTS = 300
SHORT = 1e-6  # of the run: the first step after an event, where a speed that leaves zero may have the wrong sign by rounding
FREE, STUCK, FORWARD, BACKWARD = "free", "stuck", "forward", "backward"
PLAIN = Signal(bias=1.0)


@dataclass
class Rubbing:
    """Friction between a direction of motion and what it is relative to."""

    part: Part
    row: Floats  # relative speed = row @ v
    one_way: bool = False
    mode: str = STUCK
    pressed: bool = True

    def press(self, t: float) -> float:
        """Normal force over the largest one; a bearing's is 1."""
        given = self.part.value("f_normalized", PLAIN)
        return float(given(t)) if isinstance(given, Signal) else float(given)

    def level(self, speed: float, t: float) -> float:
        """Torque of sliding at a positive speed."""
        if self.part.kind == "BearingFriction":
            return table(self.part.value("tau_pos"), speed)
        return (
            table(self.part.value("mu_pos"), speed)
            * self.part.value("cgeo", 1.0)
            * self.part.value("fn_max")
            * max(self.press(t), 0.0)
        )

    @property
    def peak(self) -> float:
        peak: float = self.part.value("peak", 1.0)
        return max(peak, 1 + 1e-4) if self.one_way else peak

    def limits(self, t: float) -> tuple[float, float]:
        """Torques between which it sticks."""
        largest = self.peak * self.level(0.0, t)
        if not self.one_way:
            return -largest, largest
        if not self.pressed:
            largest = 1e-4 * table(self.part.value("mu_pos"), 0.0) * self.part.value("cgeo", 1.0) * self.part.value("fn_max")
        return -np.inf, largest

    def torque(self, speed: float, t: float, mode: str) -> float:
        """What it takes while it slides or is free."""
        if mode == FREE or not self.pressed:
            return 0.0
        return self.level(speed, t) if mode == FORWARD else -self.level(-speed, t)


def table(rows: Sequence[tuple[float, float]], x: float) -> float:
    """Linear interpolation, continued along the last two rows."""
    if len(rows) == 1:
        return rows[0][1]
    k = next((k for k in range(1, len(rows)) if x < rows[k][0]), len(rows) - 1)
    (x0, y0), (x1, y1) = rows[k - 1], rows[k]
    return y0 + (y1 - y0) * (x - x0) / (x1 - x0)


@dataclass
class Gap:
    """Backlash: which side touches, and the torque."""

    part: Part
    row: Floats
    side: int = 0

    def torque(self, x: float, rate: float) -> float:
        c, d, half = self.part.value("c"), self.part.value("d"), self.part.value("b") / 2
        x = x - self.part.value("phi_rel0")
        if half <= 0.5e-10:
            return float(c * x + d * rate)
        if self.side == 0:
            return 0.0
        # seen from the side that touches, all is positive
        spring, damper = c * (self.side * x - half), d * self.side * rate
        limited = min(spring, damper) if self.part.kind == "ElastoBacklash" else damper
        return float(self.side * max(0.0, spring + limited))


def _missed(found: Any, function: Any) -> bool:
    """Whether an event that ends the integration is hidden within a step, after which its function has its old sign again."""
    steps = zip(found.t[:-1], found.t[1:], strict=True)
    ahead = function.direction * np.array(
        [function(s, found.sol(s)) for a, b in steps for s in np.linspace(a, b, 4, endpoint=False)]
    )
    rounding = 1e-9 * np.abs(ahead).max()
    before = np.flatnonzero(ahead < -rounding)
    return bool(len(before) and (ahead[before[0] :] > rounding).any())


@dataclass
class Motion:
    """The outcome: states at the samples, moments of events, and what was discrete at the samples."""

    times: Floats
    values: dict[str, Floats]
    events: list[float] = field(default_factory=list)


class HybridTrain:
    """Matrices of the smooth parts, and the elements that switch."""

    def __init__(self, train: Train) -> None:
        self.linear = linear = LinearTrain(train)
        self.train = train
        if linear.problems or linear.locked or linear.held_twice or linear.T2.shape[1] or linear.T3.shape[1]:
            raise Unclear("not every free motion has inertia")
        self.n = linear.T1.shape[1]
        if not self.n:
            raise Unclear("all motion is prescribed")  # scipy takes one step then, across all events
        self.inverse = linear.inverse[0]
        S = linear.z.S
        self.rate = linear.v_p @ S
        self.moved = np.array([linear.z.integral(row) for row in linear.v_p]).reshape(len(linear.nodes), len(S))
        self.moved[:, 0] += linear.first_angles
        spread = linear.spread
        self.rubbing: list[Rubbing] = []
        self.gaps: list[Gap] = []
        self.controllers: list[tuple[Part, Floats]] = []
        self.stops: list[tuple[Part, Floats]] = []
        self.fans: list[tuple[Part, Floats]] = []
        for part in train.parts:
            relative = spread(part, (1.0, -1.0)[: len(part.at)])
            if part.kind in ("BearingFriction", "Brake"):
                self.rubbing.append(Rubbing(part, spread(part, (1.0, 0.0, -1.0)[: len(part.at)])))
            elif part.kind in ("Clutch", "OneWayClutch"):
                self.rubbing.append(Rubbing(part, -relative, part.kind == "OneWayClutch"))
            elif part.kind in ("ElastoBacklash", "ElastoBacklash2"):
                self.gaps.append(Gap(part, -relative))
            elif part.kind == "Switched":
                self.controllers.append((part, relative))
            elif part.kind == "Kicked":
                self.stops.append((part, relative))
            elif part.kind == "QuadraticSpeedDependentTorque":
                self.fans.append((part, relative))
        stuck_to_itself = [r for r in self.rubbing if np.abs(r.row @ linear.T1).max(initial=0.0) < 1e-9]
        if stuck_to_itself:
            raise Unclear("friction between what is joined rigidly, or prescribed")

        self._fold()

    # ------------------------------------------------------------ smooth motion

    def _fold(self) -> None:
        """What is linear, folded into a few matrices: the accelerations without elements, and each element's twist and speed."""
        linear, n = self.linear, self.n
        T1, push = linear.T1, self.inverse @ linear.T1.T
        self.from_x = np.hstack([-push @ linear.K @ T1, -push @ linear.D @ T1])
        self.from_z = -push @ (linear.K @ self.moved + linear.D @ linear.v_p + linear.M @ self.rate)
        rows = [r.row for r in self.rubbing] + [g.row for g in self.gaps]
        rows += [row for _, row in [*self.controllers, *self.fans, *self.stops]]
        self.rows = np.array(rows).reshape(len(rows), len(linear.nodes))
        self.reach = self.rows @ T1
        self.twist_z, self.speed_z, self.rate_z = self.rows @ self.moved, self.rows @ linear.v_p, self.rows @ self.rate
        self.pushes = (push @ self.rows.T).T
        self.first_gap = len(self.rubbing)
        self.first_controller = self.first_gap + len(self.gaps)
        self.first_fan = self.first_controller + len(self.controllers)
        self.first_stop = self.first_fan + len(self.fans)
        self.push = push
        known = np.zeros((2 * len(rows), 2 * n))  # twists, then speeds, of the elements: what x contributes
        known[: len(rows), :n], known[len(rows) :, n:] = self.reach, self.reach
        self._from_x = np.vstack([self.from_x, known])
        self._holding: dict[tuple[int, ...], tuple[Floats, Floats]] = {}
        self._last: tuple[float, Floats] = (np.nan, np.zeros(n))

    def loaded(self, t: float) -> None:
        """Take the given torques as they are from a moment on."""
        given = self.from_z + self.push @ self.linear.forces(t)
        self._from_z = np.vstack([given, self.twist_z, self.speed_z])

    def z(self, t: float) -> Floats:
        if self._last[0] != t:
            self._last = t, self.linear.z.at(t)
        return self._last[1]

    def twist(self, k: int, t: float, x: Floats) -> float:
        """Angle of an element."""
        return float(self.reach[k] @ x[: self.n] + self.twist_z[k] @ self.z(t))

    def speed(self, k: int, t: float, x: Floats) -> float:
        return float(self.reach[k] @ x[self.n :] + self.speed_z[k] @ self.z(t))

    def angles(self, t: float, x: Floats) -> Floats:
        return self.linear.T1 @ x[: self.n] + self.moved @ self.linear.z.at(t)

    def speeds(self, t: float, x: Floats) -> Floats:
        return self.linear.T1 @ x[self.n :] + self.linear.v_p @ self.linear.z.at(t)

    def accelerations(self, t: float, x: Floats, modes: Sequence[str]) -> tuple[Floats, Floats]:
        """Of the free speeds, and the torques of the stuck elements."""
        z, n, m = self.z(t), self.n, len(self.rows)
        whole = self._from_x @ x + self._from_z @ z
        a: Floats = whole[:n]
        twists, speeds = whole[n : n + m], whole[n + m :]
        for k, (rub, mode) in enumerate(zip(self.rubbing, modes, strict=True)):
            if mode in (FORWARD, BACKWARD):
                a = a - rub.torque(float(speeds[k]), t, mode) * self.pushes[k]
        for k, gap in enumerate(self.gaps, self.first_gap):
            if gap.side or gap.part.value("b") <= 1e-10:
                a = a - gap.torque(float(twists[k]), float(speeds[k])) * self.pushes[k]
        for k, ((part, _), on) in enumerate(zip(self.controllers, self.on, strict=True), self.first_controller):
            if on:
                a = a + part.value("tau_on") * self.pushes[k]
        for k, (part, _) in enumerate(self.fans, self.first_fan):
            w = float(speeds[k])
            a = a + (part.value("tau_nominal") * w * abs(w) / part.value("w_nominal") ** 2) * self.pushes[k]
        held = tuple(k for k, mode in enumerate(modes) if mode == STUCK)
        if not held:
            return a, np.zeros(0)
        E, solver = self._held(held)
        left = -solver @ (E @ a + self.rate_z[list(held)] @ z)
        return a + self.pushes[list(held)].T @ left, -left

    def _held(self, held: tuple[int, ...]) -> tuple[Floats, Floats]:
        if held not in self._holding:
            E = self.reach[list(held)]
            compliance = E @ self.pushes[list(held)].T
            sizes = np.linalg.svd(compliance, compute_uv=False)
            if sizes[-1] < 1e-9 * sizes[0]:
                raise Unclear("elements that stick side by side share a torque in no determined way")
            self._holding[held] = E, np.linalg.inv(compliance)
        return self._holding[held]

    # ------------------------------------------------------------ events

    def settle(self, t: float, x: Floats, broken: dict[int, str]) -> None:
        """Choose the modes of all friction elements; those that have just broken away slide."""
        choices: list[tuple[str, ...]] = []
        for k, rub in enumerate(self.rubbing):
            speed = self.speed(k, t, x)
            if not rub.pressed and not rub.one_way:
                choices.append((FREE,))
            elif speed > AT_REST:
                choices.append((FORWARD,))
            elif speed < -AT_REST:
                if rub.one_way:
                    raise Unclear("a freewheel turns in the sense that it forbids")
                choices.append((BACKWARD,))
            elif k in broken:
                choices.append((broken[k], STUCK))
            else:
                choices.append((STUCK, FORWARD) if rub.one_way else (STUCK, FORWARD, BACKWARD))
        best: tuple[float, tuple[str, ...]] | None = None
        for modes in product(*choices):
            a, torques = self.accelerations(t, x, modes)
            turning = self.reach @ a + self.rate_z @ self.z(t)
            size = 1e-9 * (1.0 + float(np.abs(turning).max(initial=0.0)))
            stuck, fits = iter(torques), True
            for k, (rub, mode) in enumerate(zip(self.rubbing, modes, strict=True)):
                if mode == STUCK:
                    low, high = rub.limits(t)
                    tau = next(stuck)
                    slack = 1e-9 * (1 + abs(high))
                    fits &= low - slack <= tau <= high + slack and (k not in broken)
                elif mode in (FORWARD, BACKWARD) and abs(self.speed(k, t, x)) <= AT_REST:
                    pull = float(turning[k]) * (1 if mode == FORWARD else -1)
                    fits &= pull >= (-size if k in broken else size)
            if fits:
                best = (0.0, modes)
                break
        if best is None:
            raise Unclear("no modes agree with the accelerations they cause")
        for rub, mode in zip(self.rubbing, best[1], strict=True):
            rub.mode = mode

    def watched(self) -> Iterator[tuple[Callable[[float, Floats], float], int, Callable[[float, Floats], Floats]]]:
        """Functions whose zeros are events, the sense in which they cross, and what happens to the state."""
        modes = [r.mode for r in self.rubbing]
        held = [k for k, mode in enumerate(modes) if mode == STUCK]

        def same(t: float, x: Floats) -> Floats:
            return x

        for k, rub in enumerate(self.rubbing):
            given = rub.part.value("f_normalized", 0.0)
            if isinstance(given, Signal) and (given.amplitude or given.slope):

                def pressed(t: float, x: Floats, rub: Rubbing = rub) -> Floats:
                    rub.pressed = not rub.pressed
                    return x

                yield lambda t, x, rub=rub: rub.press(t), -1 if rub.pressed else 1, pressed
            if rub.mode in (FORWARD, BACKWARD):
                sense = 1.0 if rub.mode == FORWARD else -1.0
                yield lambda t, x, k=k, sense=sense: sense * self.speed(k, t, x), -1, same
            elif rub.mode == STUCK:
                i = held.index(k)

                def above(t: float, x: Floats, rub: Rubbing = rub, i: int = i) -> float:
                    return rub.limits(t)[1] - float(self.accelerations(t, x, modes)[1][i])

                def below(t: float, x: Floats, rub: Rubbing = rub, i: int = i) -> float:
                    return float(self.accelerations(t, x, modes)[1][i]) - rub.limits(t)[0]

                for function, way in ((above, FORWARD), *(() if rub.one_way else ((below, BACKWARD),))):

                    def breaks(t: float, x: Floats, k: int = k, way: str = way) -> Floats:
                        self.broken[k] = way
                        return x

                    yield function, -1, breaks
        for k, gap in enumerate(self.gaps, self.first_gap):
            half = gap.part.value("b") / 2
            if half <= 0.5e-10:
                continue
            for side in (1, -1):

                def depth(t: float, x: Floats, k: int = k, gap: Gap = gap, side: int = side, half: float = half) -> float:
                    return side * (self.twist(k, t, x) - gap.part.value("phi_rel0")) - half

                def touched(t: float, x: Floats, gap: Gap = gap, side: int = side) -> Floats:
                    gap.side = 0 if gap.side == side else side
                    return x

                yield depth, -1 if gap.side == side else 1, touched
        for i, (part, _) in enumerate(self.controllers):
            limit, sense = (part.value("w_high"), 1) if self.on[i] else (part.value("w_low"), -1)

            def switched(t: float, x: Floats, i: int = i) -> Floats:
                self.on[i] = 1 - self.on[i]
                self.counts[i] += self.on[i]
                return x

            yield lambda t, x, k=self.first_controller + i, limit=limit: self.speed(k, t, x) - limit, sense, switched
        for i, (part, row) in enumerate(self.stops):

            def bounced(t: float, x: Floats, i: int = i, part: Part = part, row: Floats = row) -> Floats:
                self.hits[i] += 1
                return self.struck(t, x, row, -(1 + part.value("restitution")) * float(row @ self.speeds(t, x)))

            yield lambda t, x, part=part, k=self.first_stop + i: self.twist(k, t, x) - part.value("phi_stop"), 1, bounced

    def struck(self, t: float, x: Floats, row: Floats, change: float) -> Floats:
        """A body's speed changes at once; it shares its speed with no other."""
        x = x.copy()
        reach = row @ self.linear.T1
        x[self.n :] += reach * change / float(reach @ reach)
        return x

    # ------------------------------------------------------------ a run

    def solve(self, times: Floats, disturbed: Floats | None = None, rtol: float = 1e-12) -> Motion:
        """Histories of angles, speeds, twists, torques and modes; ``disturbed`` is added to the start."""
        linear, train = self.linear, self.train
        self.broken: dict[int, str] = {}
        x = np.concatenate([np.zeros(self.n), linear.start()[-self.n :] if self.n else np.zeros(0)])
        if disturbed is not None:
            x = x + disturbed[: len(x)]
        t = 0.0
        self.loaded(t)
        for rub in self.rubbing:
            rub.pressed = rub.press(t) > 0
        v = self.speeds(t, x)
        self.on = [int(float(row @ v) < part.value("w_low")) for part, row in self.controllers]
        self.counts, self.hits = [0] * len(self.on), [0] * len(self.stops)
        for gap in self.gaps:
            twist, half = float(gap.row @ self.angles(t, x)) - gap.part.value("phi_rel0"), gap.part.value("b") / 2
            gap.side = 1 if twist > half else -1 if twist < -half else 0
        given = {m for p in train.parts for _, s in p.signals() for m, _ in s.steps} | set(linear.moments)
        moments = sorted(
            {m for m in given if 0 < m < train.t_end}
            | {p.value("moment") for p, _ in self.stops if p.value("moment") < train.t_end}
        )
        self.settle(t, x, {})
        events: list[float] = []
        values: dict[str, list[float]] = {}
        order = sorted(float(s) for s in times)
        done = 0
        for stop in [*moments, train.t_end]:
            last = float(np.nextafter(stop, 0.0))  # signals that jump at the end of a stretch have their earlier values in it
            while t < stop:
                watched = list(self.watched())
                functions: list[Any] = []
                for function, sense, _ in watched:
                    wrapped: Any = lambda t, x, function=function, last=last: function(min(t, last), x)  # noqa: E731
                    wrapped.terminal, wrapped.direction = True, sense
                    functions.append(wrapped)
                modes = [r.mode for r in self.rubbing]

                def rates(t: float, x: Floats, modes: list[str] = modes, last: float = last) -> Floats:
                    return np.concatenate([x[self.n :], self.accelerations(min(t, last), x, modes)[0]])

                for longest in (0.02, 0.001):
                    found = solve_ivp(
                        rates, (t, stop), x, "DOP853", rtol=rtol, atol=rtol * 0.01, events=functions or None, dense_output=True,
                        max_step=longest * train.t_end, first_step=min(SHORT * train.t_end, stop - t),
                    )  # fmt: skip
                    if found.status < 0:
                        raise Unclear("the reference's integrator gave up")
                    if not any(_missed(found, function) for function in functions):
                        break
                end = float(found.t[-1])
                while done < len(order) and (order[done] < end or (order[done] == end == train.t_end)):
                    self._record(values, order[done], found.sol(order[done]) if order[done] > t else x)
                    done += 1
                t, x = end, found.y[:, -1]
                if found.status == 1:
                    events.append(t)
                    for (*_, action), hit in zip(watched, found.t_events, strict=True):
                        if len(hit):
                            x = action(t, x)
                    if len(events) > MOST_EVENTS:
                        raise Unclear("too many events")
                    self.settle(t, x, self.broken)
                    self.broken = {}
            if stop < train.t_end:
                events.append(stop)
                self.loaded(stop)
                for rub in self.rubbing:
                    given = rub.part.value("f_normalized", PLAIN)
                    if isinstance(given, Signal) and any(m == stop for m, _ in given.steps):
                        rub.pressed = rub.press(stop) > 0
                for part, row in self.stops:
                    if part.value("moment") == stop:
                        x = self.struck(stop, x, row, part.value("kick"))
                self.settle(t, x, {})
        while done < len(order):
            self._record(values, order[done], x)
            done += 1
        return Motion(np.array(order), {n: np.array(v) for n, v in values.items()}, events)

    def _record(self, values: dict[str, list[float]], t: float, x: Floats) -> None:
        linear = self.linear
        q, v = self.angles(t, x), self.speeds(t, x)
        torques = iter(self.accelerations(t, x, [r.mode for r in self.rubbing])[1])

        def put(name: str, value: float) -> None:
            values.setdefault(name, []).append(float(value))

        for part in self.train.parts:
            one = linear.spread(part, (1.0,))
            across = linear.spread(part, (-1.0, 1.0))
            if part.kind in ("Inertia", "Kicked"):
                put(f"{part.name}.phi", one @ q)
                put(f"{part.name}.w", one @ v)
            elif part.kind in (
                "Spring",
                "Damper",
                "SpringDamper",
                "ElastoBacklash",
                "ElastoBacklash2",
                "Clutch",
                "OneWayClutch",
            ):
                put(f"{part.name}.phi_rel", across @ q)
                put(f"{part.name}.w_rel", across @ v)
        for rub in self.rubbing:
            stuck = rub.mode == STUCK
            put(f"{rub.part.name}.tau", next(torques) if stuck else rub.torque(float(rub.row @ v), t, rub.mode))
            put(f"{rub.part.name} slides", 0 if stuck or rub.mode == FREE else 1 if rub.mode == FORWARD else -1)
        for gap in self.gaps:
            put(f"{gap.part.name}.tau", gap.torque(float(gap.row @ q), float(gap.row @ v)))
        for (part, _), on, count in zip(self.controllers, self.on, self.counts, strict=True):
            put(f"{part.name}.on", on)
            put(f"{part.name} counted", count)
        for (part, _), hits in zip(self.stops, self.hits, strict=True):
            put(f"{part.name}.hits", hits)
