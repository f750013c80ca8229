"""The native batch in the forms of other libraries.

In comes a batch of this package; out goes what a library trains on, to the same bits. Each is imported by those who use
it, so that the package needs none of them.
"""
