"""Models: innovation-form state space and first-principles equations."""
