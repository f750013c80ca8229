"""Speed: real-time factors, shares of time, operation counts, costs of terms."""
