"""Validation against a measured swimmer: its unknowns from four speeds, and predictions of the others."""
