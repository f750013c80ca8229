"""Time stepping: Newton's method, implicit stages, the guard of troubled steps, whole strokes."""
