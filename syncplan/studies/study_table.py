"""The table of studies, which command line, service, client, page and documentation read."""

from collections.abc import Mapping
from types import MappingProxyType

from syncplan.studies.designs import Designs
from syncplan.studies.flights import Flights
from syncplan.studies.refinements import Refinements
from syncplan.studies.replays import Replays
from syncplan.studies.study import Study
from syncplan.studies.sweeps import Sweeps
from syncplan.studies.validations import Validations

STUDIES: Mapping[str, Study] = MappingProxyType(
    {
        study.name: study
        for study in (Refinements(), Validations(), Flights(), Sweeps(), Replays(), Designs())
    }
)
"""Every study by its name."""
