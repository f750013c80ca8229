"""Training on the tasks whose headroom is measured: hyperparameters of each, memory, and the bundled policies."""
