"""How many odd devices `cvg fleet` finds in a large fleet, how many it names falsely, and whether it names what all share.

    python3 benches/fleet/odd_devices.py target/release/cvg --devices 2000 --out target/odd

Wants the command `cvg` and nothing else. Every device has gains of its own and the skew of a common board; one in a hundred is
odd, by an effect that the others lack or by a gain far from theirs. What was planted is written to `planted.csv` in the folder,
which nothing that identifies reads; devices and answers that are there are kept.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import pathlib
import random
import subprocess
from concurrent.futures import ThreadPoolExecutor

SHARED = "detection-skew"
#: what an odd device has: an effect by its line in the scenario, or a gain
ODD = [
    ("detection-cubic", "kappa = 0.01"),
    ("detection-offset", "offset_x = 5e-4, offset_y = -3e-4"),
    ("harmonic-n", "n = 6.0, harmonic_cos = 1e-3, harmonic_sin = 4e-4"),
    ("time-periodic", "frequency = 3.3, periodic_cos = 1e-3"),
    ("detection-gain-mismatch", ""),
    ("actuation-gain-mismatch", ""),
]
#: name, kind, and what a scenario says of it
RUNS = [
    *((f"rot{rate:+}", "rotation", f"rate_dps = {rate}.0, settle_s = 0.5, duration_s = 4.0") for rate in (500, -300)),
    ("check", "rotation", 'rate_dps = 400.0, settle_s = 0.5, duration_s = 4.0, use = "holdout"'),
    *((f"ringdown-{at}", "ringdown", f"angle_deg = {at}.0, energy_off_s = 3.0, duration_s = 8.0") for at in (0, 90)),
]
#: devices of one seed and of the next have no number in common
MOST_DEVICES = 1_000_000


def scenario(number: int, odd: tuple[str, str] | None, seed: int) -> str:
    own = (seed - 1) * MOST_DEVICES + number
    draw = random.Random(own)
    # some devices are made less evenly than others: tails heavier than a normal distribution's
    spread = 3.0 if draw.random() < 0.05 else 1.0
    detection = 1.0132 + draw.gauss(0.0, 1e-3 * spread)
    actuation = 1.0113 + draw.gauss(0.0, 1e-3 * spread)
    if odd and odd[0] == "detection-gain-mismatch":
        detection += 0.03
    if odd and odd[0] == "actuation-gain-mismatch":
        actuation -= 0.03
    effects = [
        f'{{ id = "detection-gain-mismatch", detection_gain_ratio = {detection} }}',
        f'{{ id = "actuation-gain-mismatch", actuation_gain_ratio = {actuation} }}',
        f'{{ id = "{SHARED}", skew = {2e-3 + draw.gauss(0.0, 2e-4)} }}',
    ]
    if odd and odd[1]:
        effects.append(f'{{ id = "{odd[0]}", {odd[1]} }}')
    runs = ", ".join(f'{{ kind = "{kind}", file = "{name}.csv", {said} }}' for name, kind, said in RUNS)
    return f"""
device = "unit-{number:04}"
angular_gain = {0.78 + draw.gauss(0.0, 5e-4)}
angular_gain_stated = 0.78
noise_v = {2e-5 * math.exp(draw.gauss(0.0, 0.2))}
tau_s = {10.0 + draw.gauss(0.0, 0.3)}
seed = {own}
effects = [ {", ".join(effects)} ]
run = [ {runs} ]
"""


def simulated(cvg: str, folder: pathlib.Path, number: int, odd: tuple[str, str] | None, seed: int) -> None:
    own = folder / "devices" / f"unit-{number:04}"
    if (own / "campaign.toml").exists():
        return
    text = folder / f"{number}.toml"
    text.write_text(scenario(number, odd, seed))
    subprocess.run([cvg, "simulate", text, "--out", own], check=True, capture_output=True)
    text.unlink()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("cvg")
    parser.add_argument("--devices", type=int, default=2000)
    parser.add_argument("--every", type=int, default=100, help="one device in so many is odd")
    parser.add_argument("--seed", type=int, default=1, help="another gives other devices, of which others are odd")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    said = parser.parse_args()
    said.out.mkdir(parents=True, exist_ok=True)
    plant = random.Random(said.seed)
    at = sorted(plant.sample(range(said.devices), max(1, said.devices // said.every)))
    planted = {number: ODD[place % len(ODD)] for place, number in enumerate(at)}
    with (said.out / "planted.csv").open("w") as file:
        csv.writer(file).writerows([f"unit-{number:04}", odd[0]] for number, odd in planted.items())
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda n: simulated(said.cvg, said.out, n, planted.get(n), said.seed), range(said.devices)))
    answers = said.out / "answers"
    subprocess.run([said.cvg, "fleet", said.out / "devices", "--out", answers], check=True, stdout=subprocess.DEVNULL)

    facts = json.loads((answers / "fleet.json").read_text())
    named = {odd["device"]: odd["by"] for odd in facts["odd"]}
    kind = {f"unit-{number:04}": odd[0] for number, odd in planted.items()}
    for what in dict.fromkeys(kind.values()):
        own = [device for device, is_of in kind.items() if is_of == what]
        print(f"{what}: {sum(device in named for device in own)} of {len(own)} found")
    for device in sorted(set(kind) - set(named)):
        print(f"missed: {device} ({kind[device]})")
    false = sorted(set(named) - set(kind))
    for device in false:
        print(f"false: {device}: {', '.join(named[device])}")
    found = len(set(named) & set(kind))
    print(f"{facts['answered']} of {facts['devices']} answered, {found} of {len(kind)} odd devices found ({found / len(kind):.1%})")
    print(f"{len(false)} of {facts['devices'] - len(kind)} others named falsely ({len(false) / (facts['devices'] - len(kind)):.2%})")
    print("shared:", ", ".join(effect["id"] for effect in facts["effects"] if effect["shared"]))


if __name__ == "__main__":
    main()
