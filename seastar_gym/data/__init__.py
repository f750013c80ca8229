"""Minari datasets of swims on the native batch.

recorder.py   keeps every decision of a batch, whoever chooses the actions
dataset.py    from kept episodes to a dataset on disk
command.py    `seastar data`
"""
