"""Training on the tasks whose headroom is measured: hyperparameters of each, memory, and the policies in the box."""
