"""The corpus of simulated pairs: which there are, how they are made, how answers are judged."""
