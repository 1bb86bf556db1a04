"""Which detector suits these photos: all of them, with all matchers, on the same pairs and before the same judge."""

from panostitch.jobs.detectors.picture import picture as picture
from panostitch.jobs.detectors.trials import LICENCES as LICENCES
from panostitch.jobs.detectors.trials import Contest as Contest
from panostitch.jobs.detectors.trials import Trial as Trial
from panostitch.jobs.detectors.trials import hold as hold
