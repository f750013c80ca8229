"""What matters to the learning, and the best that a search finds."""
