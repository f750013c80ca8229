"""Comparison with beam theory, exact solutions and published codes."""
