"""Run recordings through the C filters, the very code that runs in a controller."""

from aeolid.filters.replay import filter_record, replay_filter
from aeolid.filters.result import FilterResult, save_markov
from aeolid.filters.settings import COUNTERS, METHODS, REGRESSORS_MAX, FilterSettings

__all__ = [
    "COUNTERS", "METHODS", "REGRESSORS_MAX", "FilterResult", "FilterSettings", "filter_record", "replay_filter",
    "save_markov",
]  # fmt: skip
