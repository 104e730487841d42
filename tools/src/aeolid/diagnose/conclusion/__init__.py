"""Verdict, wording, corrected model, files."""
