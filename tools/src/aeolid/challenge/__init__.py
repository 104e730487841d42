"""Make cases with concealed physics, have them diagnosed, and score the answers against a sealed truth."""
