"""Robots as stars of rods: nodes, edges, hinges and their coefficients."""
