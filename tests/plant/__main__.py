"""Run a bench day on a specimen and log it: `PYTHONPATH=tests python -m plant day.csv SEED FOLDER [CAUSE SIZE]`."""

from __future__ import annotations

import sys
from pathlib import Path

from plant import Effect, Plant, day, record, write_campaign

AFTER = 20  # days after the first session of a specimen's campaign


def run(file: Path, plant: Plant, folder: Path, number: int = AFTER) -> Path:
    """The log of the day, the so manyth session of the specimen, beside motor, bench and DBC file."""
    truth = plant.run(day.read(file, plant.form.machine), number)
    return write_campaign(folder, plant, [record(plant, truth)])[0]


if __name__ == "__main__":
    if len(sys.argv) not in (4, 6):
        sys.exit(__doc__)
    csv, seed, target, *hidden = sys.argv[1:]
    effects = [Effect(hidden[0], float(hidden[1]))] if hidden else []
    print(run(Path(csv), Plant(int(seed), *effects), Path(target)))
