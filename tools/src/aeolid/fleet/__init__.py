"""Follow the modes of many turbines over months: recordings to factors, factors to models, models to drift."""
