"""Benchmark: agents on registered tasks over seeds, as a table, performance profiles and a file that can be merged."""
