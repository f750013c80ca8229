"""How both discretisations tend to the same robot as nodes are added, term by term: `python -m studies.continuum`."""
