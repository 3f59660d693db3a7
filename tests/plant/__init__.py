"""An independent truth: a conduction mesh of a motor on its bench, which knows nothing of the product. See
README.md."""

from plant.campaign import sessions, write_campaign
from plant.effects import CATALOGUE, Effect, typical
from plant.plant import Plant, Truth
from plant.sensors import Recording, record

__all__ = ["CATALOGUE", "Effect", "Plant", "Recording", "Truth", "record", "sessions", "typical", "write_campaign"]
