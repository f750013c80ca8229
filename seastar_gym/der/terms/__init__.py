"""The terms of (13.9), one file each."""
