"""Hold a simulator's run against recordings: the run as prior of the recording's predictor, hypotheses as operators."""
