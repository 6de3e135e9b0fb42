"""A policy learned by gradients through a loop: a network drives the crank of a four-bar to an angle, from anywhere.

Each twentieth of a second the network reads the angle and the rate of the crank and sets the torque of its motor. The
gradient of what remains after a second goes back through all runs in between, loops closed, by
`partita.torch.simulate`. Needs the extra `torch`.
"""

from __future__ import annotations

from typing import Any

import torch

import partita as pt
import partita.torch

TARGET, TICK, TICKS, UNIT = 1.5, 0.05, 20, 10.0
"""Angle of the crank [rad]; time between two decisions [s], and their number; unit of its torque [N m]."""
STARTS = (0.0, 0.8, 2.2, 3.0)
"""Angles from which it learns; it starts at rest."""


def linkage() -> pt.Mechanism:
    """A four-bar with a motor at its crank."""
    m = pt.catalogue.load("four-bar")
    m.add_torque("A", 0.0, name="motor")
    m.add_sensor("rate", "A", "velocity")
    return m


def network() -> Any:
    """Torque by the angle and the rate of the crank."""
    torch.manual_seed(1)
    layers = (torch.nn.Linear(3, 16), torch.nn.Tanh(), torch.nn.Linear(16, 1))
    policy = torch.nn.Sequential(*layers).double()
    with torch.no_grad():
        policy[2].weight *= 0.1  # at first the motor hardly turns
    return policy


def driven(m: pt.Mechanism, policy: Any, first: float) -> tuple[Any, Any, Any]:
    """Angle and rate after the last decision, and the work of the motor's amplifier, as tensors."""
    begin = m.assemble({"A": 0.0})
    angle, rate = torch.tensor(first, dtype=torch.float64), torch.tensor(0.0, dtype=torch.float64)
    effort = torch.tensor(0.0, dtype=torch.float64)
    for _ in range(TICKS):
        torque = UNIT * policy(torch.stack([torch.cos(angle), torch.sin(angle), 0.2 * rate]))[0]
        now = {"motor.value": torque, pt.start("A"): angle, pt.start_rate("A"): rate}
        angle, rate = partita.torch.simulate(
            m, now, ["A", "rate"], duration=TICK, initial=begin, held=("A",), rtol=1e-7, atol=1e-9
        )[0]
        effort = effort + TICK * torque**2
    return angle, rate, effort


def missed(m: pt.Mechanism, policy: Any, first: float) -> Any:
    """What is left to improve for one start."""
    angle, rate, effort = driven(m, policy, first)
    return (angle - TARGET) ** 2 + 0.05 * rate**2 + 1e-4 * effort


def learned(m: pt.Mechanism, policy: Any, rounds: int) -> list[float]:
    """What was left, by rounds."""
    steps = torch.optim.Adam(policy.parameters(), lr=0.05)
    left = []
    for _ in range(rounds):
        steps.zero_grad()
        losses = [missed(m, policy, first) for first in STARTS]
        for loss in losses:
            loss.backward()
        steps.step()
        left.append(sum(loss.item() for loss in losses) / len(STARTS))
    return left


def main() -> None:
    """Learn, and say where the crank arrives."""
    m, policy = linkage(), network()
    left = learned(m, policy, 100)
    print(f"left on average: {left[0]:.3f} at first, {left[-1]:.3f} after {len(left)} rounds")
    for first in (*STARTS, 0.4, 2.6):
        angle, rate, _ = driven(m, policy, first)
        kind = "learned" if first in STARTS else "new"
        print(f"from {first:4.1f} rad ({kind}): {angle.item():6.3f} rad, {rate.item():6.3f} rad/s; wanted {TARGET} rad")


if __name__ == "__main__":
    main()
