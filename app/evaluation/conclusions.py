"""What is made of the reports of each suite that drives."""

from __future__ import annotations

from collections.abc import Mapping

from app.evaluation.campaign import Conclusion
from app.evaluation.driving import barn, crossings, doors, scenario
from app.evaluation.suites import Suite
from app.fleet.campaign_files import CampaignCard
from navcore.errors import BadConfiguration

CONCLUSIONS: Mapping[str, Conclusion] = {
    **scenario.CONCLUSIONS,
    **barn.CONCLUSIONS,
    **crossings.CONCLUSIONS,
    Suite.DOORS: doors.CONCLUSION,
}


def conclusion_of(card: CampaignCard) -> Conclusion:
    """Return what is made of a campaign; raises `BadConfiguration` for a suite that runs as a
    whole."""
    if card.suite not in CONCLUSIONS:
        raise BadConfiguration(
            f"the suite {card.suite!r} runs as a whole; its episodes are no campaign that is "
            "merged or driven on"
        )
    return CONCLUSIONS[card.suite]
