"""Measurements of speed: real-time factors, shares of time, operation counts, and the cost of terms."""
