"""Hand the facts of a reception or a fleet on to brokers, time-series databases and scrapers."""
