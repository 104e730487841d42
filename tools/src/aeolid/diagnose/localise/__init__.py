"""The maps: where in time, region, channel and equation a baseline leaves something over."""
