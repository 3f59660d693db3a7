"""The fit of a campaign as a diagnosis begins: everything that a healthy motor may do, and no cause."""

from __future__ import annotations

from replay.studies.diagnosis.question import Campaign
from twin.diagnosis.refined import Tell, calibrated
from twin.differences.everyday import everyday
from twin.fitting.fit import Fit
from twin.fitting.model import Model


def healthy_fit(campaign: Campaign, tell: Tell) -> Fit:
    """Raises `DivergedError` where the file's own run leaves the finite numbers."""
    healthy = Model(campaign.network, campaign.tests, everyday(campaign.network, campaign.tests))
    return calibrated(healthy, campaign.candidates, tell)
