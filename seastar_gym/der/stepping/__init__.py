"""Time stepping: Newton's method, implicit stages, the guard of energies, whole strokes."""
