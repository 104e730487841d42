"""Statistics that several rooms share: blocks of residuals, projections, numbers as files hold them."""
