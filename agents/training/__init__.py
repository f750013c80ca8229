"""Parts of a training run by `train.py`: its options, its folder, what watches it, and the bundled policy."""
