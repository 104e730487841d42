"""The stochastic predictor: noise, gain, innovations; their sensitivities and steps; fits above them."""
