"""Do the statements about many recordings hold? Coverage of spreads and means, false alarms, orders of polynomials.

The generator is independent of the estimators: it draws numbers of sessions
from stated distributions, and counts how often the truth lies in what is said.

    python benches/many_recordings.py [--trials 400] [--seed 1]
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from trihedron.estimate.sessions import changes_among, common_mean, spread_between, spread_within, thermal_model
from trihedron.records.sessions import PARAMETERS, Session


def coverage_of_spreads(rng: np.random.Generator, trials: int) -> None:
    print("spread from session to session: 95 % intervals that hold the truth; ratio of widths (upper/lower)")
    print("  sessions  spread/own error   spread %   mean %   median upper/truth")
    for n in (3, 5, 10):
        for ratio in (0.0, 0.5, 1.0, 3.0):
            held = mean_held = 0
            upper = []
            for _ in range(trials):
                # Own errors differ by a factor of three from session to session, as real ones do.
                own = np.exp(rng.uniform(-0.55, 0.55, n))
                sigma = ratio
                y = 7.0 + sigma * rng.normal(size=n) + own * rng.normal(size=n)
                spread = spread_within(y, own**2, ["a"] * n)
                mean = common_mean(y, own**2, ["a"] * n, spread, None)
                held += spread.low <= sigma <= spread.high
                mean_held += abs(mean.value - 7.0) <= mean.half_width
                upper.append(spread.high / max(sigma, 1e-9))
            tail = f"{np.median(upper):8.1f}" if ratio else "       -"
            print(f"  {n:8d}  {ratio:16.1f}   {100 * held / trials:8.1f} {100 * mean_held / trials:8.1f} {tail}")


def coverage_nested(rng: np.random.Generator, trials: int) -> None:
    print("day to day, with turn-on to turn-on below it (own error 1): 95 % intervals that hold the truth")
    print("  days x sessions   within  between   within %  between %   mean %")
    for days, each in ((3, 2), (3, 4), (5, 3), (10, 2)):
        for within, between in ((1.0, 0.0), (1.0, 2.0), (0.3, 1.0)):
            held = np.zeros(3)
            for _ in range(trials):
                groups = [d for d in range(days) for _ in range(each)]
                own = np.exp(rng.uniform(-0.3, 0.3, len(groups)))
                day = between * rng.normal(size=days)
                y = np.array([day[g] for g in groups]) + within * rng.normal(size=len(groups))
                y = y + own * rng.normal(size=len(groups))
                a, b = spread_within(y, own**2, groups), spread_between(y, own**2, groups)
                mean = common_mean(y, own**2, groups, a, b)
                held += (a.low <= within <= a.high, b.low <= between <= b.high, abs(mean.value) <= mean.half_width)
            percent = 100 * held / trials
            print(
                f"  {days:4d} x {each:<8d}   {within:6.1f}  {between:7.1f}   {percent[0]:8.1f} {percent[1]:9.1f} "
                f"{percent[2]:9.1f}"
            )


def drawn_sessions(rng: np.random.Generator, n: int, poses: int = 24) -> list[Session]:
    """Sessions of one unit that did not change. Their covariances are estimated: from ``poses`` poses each."""
    k = len(PARAMETERS)
    truth_root = np.tril(rng.normal(size=(k, k))) / np.sqrt(k) + 0.5 * np.eye(k)
    scale = np.array([{"m/s^2": 1e-3, "rad/s": 2e-4, "1": 2e-4, "rad": 2e-4}[p.unit] for p in PARAMETERS])
    zeros = np.array([p.id.endswith("zero") for p in PARAMETERS])
    out = []
    for s in range(n):
        root = scale[:, None] * truth_root * rng.uniform(0.7, 1.4)
        covariance = root @ root.T
        wander = np.where(zeros, np.diag(covariance) * rng.uniform(0.5, 2.0), 0.0)
        y = root @ rng.normal(size=k) + np.sqrt(wander) * rng.normal(size=k)
        # What is stated is not the truth: an estimate from so many poses, and the wander from so few.
        stated = covariance * rng.chisquare(poses) / poses
        seen = wander * rng.chisquare(5) / 5
        out.append(Session(f"session {s + 1}", "", y, stated, seen))
    return out


def false_changes(rng: np.random.Generator, trials: int) -> None:
    print("a unit that did not change: any number called changed (alpha 1 %); power for one session apart by 5 errors")
    print("  sessions   false %   found %   named apart %")
    for n in (2, 3, 5, 10):
        false = found = named = 0
        for _ in range(trials):
            sessions = drawn_sessions(rng, n)
            false += any(c.significant for c in changes_among([sessions], alpha=0.01))
            k = int(rng.integers(n))
            moved = sessions[k].numbers.copy()
            axis = 12 + int(rng.integers(3))
            moved[axis] += 5.0 * np.sqrt(sessions[k].covariance[axis, axis])
            sessions[k] = replace(sessions[k], numbers=moved)
            changes = [c for c in changes_among([sessions], alpha=0.01) if c.significant]
            hit = [c for c in changes if c.id == "gyro-scale"]
            found += bool(hit)
            named += bool(hit) and (n == 2 or (hit[0].kind == "apart" and hit[0].where == sessions[k].name))
        print(f"  {n:8d}  {100 * false / trials:8.1f}  {100 * found / trials:8.1f}  {100 * named / trials:8.1f}")


def orders(rng: np.random.Generator, trials: int) -> None:
    print("temperature: order chosen for gyro zeros of true order 0, 1, 2 (swing 6 own errors), per cent")
    print("  sessions  true     0     1     2     3   hysteresis false   hysteresis found")
    picked = [k for k, p in enumerate(PARAMETERS) if p.id == "gyro-zero"]
    for n in (6, 10, 20):
        for order in (0, 1, 2):
            counts = np.zeros(4)
            false = hit = 0
            for t in range(trials):
                sessions = []
                T = np.linspace(-10, 50, n)[rng.permutation(n)]
                with_branch = t % 2 == 1
                for s in range(n):
                    own = 2e-4
                    y = np.zeros(len(PARAMETERS))
                    x = (T[s] - 20.0) / 30.0
                    branch = 1 if s % 2 else -1
                    level = own * np.array([0.0, 6.0 * x, 6.0 * x + 6.0 * x**2][order])
                    y[picked] = level + own * rng.normal(size=3) + 0.5 * own * rng.normal(size=3)
                    if with_branch:
                        y[picked] += 3.0 * own * branch
                    C = np.eye(len(PARAMETERS)) * own**2
                    sessions.append(
                        Session(
                            f"s{s}", "", y, C, np.zeros(len(y)), 0.0, float(T[s]), (float(T[s]), float(T[s])), branch
                        )
                    )
                term = next(t for t in thermal_model(sessions).terms if t.id == "gyro-zero")
                if with_branch:
                    hit += term.hysteresis is not None
                else:
                    counts[term.order] += 1
                    false += term.hysteresis is not None
            half = trials / 2
            percent = "".join(f"{100 * c / half:6.1f}" for c in counts)
            print(f"  {n:8d}  {order:4d}{percent}   {100 * false / half:12.1f}   {100 * hit / half:12.1f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    print(f"seed {given.seed}, {given.trials} trials a line")
    coverage_of_spreads(rng, given.trials)
    false_changes(rng, given.trials)
    coverage_nested(rng, given.trials // 4)
    orders(rng, given.trials // 8 * 2)


if __name__ == "__main__":
    main()
