"""What was recorded: cases, segments, quality, splitting, sample times, frames and covariates."""
