"""From a scene to the coefficients that the kernels read."""
