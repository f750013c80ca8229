"""Accuracy and its cost: errors of every scheme and step against converged paths."""
