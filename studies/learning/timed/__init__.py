"""Policies learned for decisions of different length, by different learners, and at different prices of heat."""
