"""What speed costs in accuracy: errors of every scheme and step against converged paths."""
